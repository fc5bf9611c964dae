/* X servers of a test's own: started on a display number that is free, ended with the test whatever becomes of it. */
#ifndef CLT_TESTS_DISPLAY_H
#define CLT_TESTS_DISPLAY_H

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <X11/Xlib.h>
#include <X11/Xutil.h>

#include "support.h"

enum { TEST_SKIPPED = 77 };

typedef struct test_display {
  pid_t server;
  Display *x; /* a connection that is not the projector's */
} test_display;

static inline void test_display_run(char *const *arguments, int number) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  int quiet = open("/dev/null", O_RDWR);
  dup2(quiet, STDOUT_FILENO);
  dup2(quiet, STDERR_FILENO);
  dup2(number, 3);
  execvp(arguments[0], arguments);
  _exit(127);
}

/* Starts a server that writes its number to descriptor 3 (-displayfd 3) and sets DISPLAY. False where there is none. */
static inline bool test_display_start(char *const *arguments, test_display *display) {
  int ends[2];
  char number[16] = ":";
  assert_int_equal(pipe(ends), 0);
  display->server = fork();
  assert_true(display->server >= 0);
  if (display->server == 0) {
    test_display_run(arguments, ends[1]);
  }
  close(ends[1]);
  size_t used = 1;
  while (used < sizeof number - 1 && read(ends[0], number + used, 1) == 1 && number[used] != '\n') {
    used++;
  }
  close(ends[0]);
  if (number[used] != '\n') {
    waitpid(display->server, NULL, 0);
    return false;
  }
  number[used] = '\0';
  setenv("DISPLAY", number, 1);
  unsetenv("WAYLAND_DISPLAY");
  setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
  display->x = XOpenDisplay(NULL);
  return display->x != NULL;
}

/* Xvfb with a screen as in "1280x800x24". */
static inline bool test_display_xvfb(const char *screen, test_display *display) {
  char *const arguments[] = {"Xvfb",      "-displayfd", "3",        "-screen", "0", (char *)(uintptr_t)screen,
                             "-nolisten", "tcp",        "-noreset", NULL};
  return test_display_start(arguments, display);
}

/* The same without memory that it shares with its clients. */
static inline bool test_display_unshared(const char *screen, test_display *display) {
  char *const arguments[] = {"Xvfb",      "-displayfd", "3",        "-screen",    "0",       (char *)(uintptr_t)screen,
                             "-nolisten", "tcp",        "-noreset", "-extension", "MIT-SHM", NULL};
  return test_display_start(arguments, display);
}

static inline void test_display_stop(test_display *display) {
  if (display->x != NULL) {
    XCloseDisplay(display->x);
  }
  kill(display->server, SIGTERM);
  waitpid(display->server, NULL, 0);
}

/* What is on the screen: out[(y * width + x) * 3 + c], in the screen's own steps. */
static inline void test_display_grab(test_display *display, int x, int y, int width, int height, uint16_t *out) {
  XImage *image =
      XGetImage(display->x, DefaultRootWindow(display->x), x, y, (unsigned)width, (unsigned)height, AllPlanes, ZPixmap);
  assert_non_null(image);
  Visual *visual = DefaultVisual(display->x, DefaultScreen(display->x));
  const unsigned long masks[3] = {visual->red_mask, visual->green_mask, visual->blue_mask};
  for (int row = 0; row < height; row++) {
    for (int column = 0; column < width; column++) {
      unsigned long pixel = XGetPixel(image, column, row);
      for (int c = 0; c < 3; c++) {
        out[(row * width + column) * 3 + c] = (uint16_t)((pixel & masks[c]) >> __builtin_ctzl(masks[c]));
      }
    }
  }
  XDestroyImage(image);
}

#endif
