#include "device/projector/swap.h"

#include <errno.h>
#include <time.h>

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "base/clock.h"
#include "base/log.h"
#include "device/projector/desktop.h"

/* Swaps that fill the queue before the screen, then those that are timed. */
enum { FILLING = 6, TIMED = 9 };
/* A swap that has returned on X11 is up at the next refresh. On Wayland it was handed over after the refresh before was
 * composed: it is composed at the next one, and up at the one after that. */
enum { LAG_X11 = 1, LAG_WAYLAND = 2 };

static void sleep_until(int64_t time_ns) {
  const struct timespec until = {.tv_sec = time_ns / 1000000000, .tv_nsec = time_ns % 1000000000};
  while (time_ns > 0 && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
  }
}

/* Swaps when all is drawn, so that only waiting for the screen takes time; *began_ns is when. */
static int64_t swap_buffers(const clt_swap *swap, int64_t *began_ns) {
  glFinish();
  *began_ns = clt_clock_ns();
  glfwSwapBuffers(swap->window);
  if (!swap->stamps) {
    glFinish();
    clt_desktop_finish();
  }
  return clt_clock_ns();
}

static void swap_black(const clt_swap *swap) {
  int64_t began_ns;
  glClear(GL_COLOR_BUFFER_BIT);
  swap_buffers(swap, &began_ns);
  glfwPollEvents();
}

void clt_swap_open(clt_swap *swap, struct GLFWwindow *window, double refresh_hz) {
  double between_ns[TIMED];
  *swap = (clt_swap){.window = window};
  glfwSwapInterval(1);
  glClearColor(0, 0, 0, 1);
  for (int i = 0; i < FILLING; i++) {
    swap_black(swap);
  }
  for (int i = 0; i < TIMED; i++) {
    int64_t start_ns = clt_clock_ns();
    swap_black(swap);
    between_ns[i] = (double)(clt_clock_ns() - start_ns);
  }
  bool throttled = clt_pacing_waits(between_ns, TIMED, refresh_hz);
  int64_t started_ns, number;
  swap->stamps = throttled && clt_desktop_stamps() && clt_desktop_last_swap(&started_ns, &number);
  clt_pacing_start(&swap->pacing, refresh_hz, throttled, clt_desktop_is_x11() ? LAG_X11 : LAG_WAYLAND, clt_clock_ns());
}

/* The display's own word, where it gives one. */
static bool show_stamped(clt_swap *swap) {
  int64_t started_ns, number;
  if (swap->stamps && clt_desktop_last_swap(&started_ns, &number)) {
    clt_pacing_stamped(&swap->pacing, started_ns, number);
    return true;
  }
  if (swap->stamps) {
    clt_log(CLT_LOG_WARNING, "the display no longer tells when it shows a picture; the clock does now");
    swap->stamps = false;
  }
  return false;
}

/* A canvas waits for nothing but the server. */
static int64_t show_canvas(clt_canvas *canvas, int64_t *began_ns) {
  *began_ns = clt_clock_ns();
  clt_canvas_show(canvas);
  return clt_clock_ns();
}

int64_t clt_swap_show(clt_swap *swap, clt_canvas *canvas) {
  int64_t began_ns;
  int64_t returned_ns = canvas != NULL ? show_canvas(canvas, &began_ns) : swap_buffers(swap, &began_ns);
  if (!show_stamped(swap)) {
    clt_pacing_swapped(&swap->pacing, began_ns, returned_ns);
    sleep_until(clt_pacing_release(&swap->pacing));
  }
  return swap->pacing.shown_ns;
}

int64_t clt_swap_pass(clt_swap *swap) {
  int64_t now_ns = clt_clock_ns();
  clt_pacing_swapped(&swap->pacing, now_ns, now_ns);
  sleep_until(swap->pacing.shown_ns);
  return swap->pacing.shown_ns;
}

const char *clt_swap_method(const clt_swap *swap) {
  return swap->stamps             ? "timed by the display"
         : swap->pacing.throttled ? "timed by its swaps"
                                  : "paced by the clock: swaps do not wait for it";
}
