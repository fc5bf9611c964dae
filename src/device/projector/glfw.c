#include "device/projector/glfw.h"

#include <stdlib.h>

#include "base/log.h"
#include "base/memory.h"
#include "device/projector/canvas.h"
#include "device/projector/glass.h"
#include "device/projector/list.h"
#include "device/projector/screen.h"
#include "device/projector/swap.h"

typedef struct glfw_projector {
  clt_projector base;
  clt_screen screen;
  clt_glass glass;
  clt_canvas *canvas; /* in the glass's place, where the processor draws; NULL: none */
  clt_swap swap;
  bool stretched; /* said so */
} glfw_projector;

static void describe(const clt_projector *projector, clt_projector_info *info) {
  const glfw_projector *self = (const glfw_projector *)projector;
  *info = (clt_projector_info){.width = self->glass.width,
                               .height = self->glass.height,
                               .channels = CLT_PANEL_CHANNELS,
                               .bits = self->glass.bits,
                               .refresh_s = self->swap.pacing.period_ns * 1e-9,
                               .waits = true};
}

static void tell_stretched(glfw_projector *self) {
  const clt_screen *screen = &self->screen;
  bool stretched = screen->width != self->glass.width || screen->height != self->glass.height;
  if (stretched && !self->stretched) {
    clt_log(CLT_LOG_WARNING, "the window is %d x %d pixels now, not %d x %d: the picture is stretched", screen->width,
            screen->height, self->glass.width, self->glass.height);
  }
  self->stretched = stretched;
}

/* The canvas that the next picture goes onto; NULL: it goes by the glass. Events are taken first, so that the window
 * has the size that is painted for. */
static clt_canvas *take_canvas(glfw_projector *self) {
  clt_screen_tend(&self->screen);
  bool fits = self->screen.width == self->glass.width && self->screen.height == self->glass.height;
  return fits ? self->canvas : NULL;
}

/* Puts what the glass or the canvas holds on the screen. */
static int64_t show(glfw_projector *self, clt_canvas *canvas) {
  if (self->screen.away || self->screen.width < 1 || self->screen.height < 1) {
    return clt_swap_pass(&self->swap);
  }
  tell_stretched(self);
  if (canvas == NULL) {
    clt_glass_draw(&self->glass, self->screen.width, self->screen.height);
  }
  return clt_swap_show(&self->swap, canvas);
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  glfw_projector *self = (glfw_projector *)projector;
  clt_canvas *canvas = take_canvas(self);
  clt_status status = CLT_OK;
  if (canvas != NULL) {
    clt_canvas_put(canvas, codes);
  } else {
    status = clt_glass_put(&self->glass, codes, error);
  }
  if (status == CLT_OK) {
    *shown_ns = show(self, canvas);
  }
  return status;
}

static clt_status present_live(clt_projector *projector, const clt_live_picture *picture, int64_t *shown_ns,
                               clt_error *error) {
  glfw_projector *self = (glfw_projector *)projector;
  clt_canvas *canvas = take_canvas(self);
  clt_status status =
      canvas != NULL ? clt_canvas_put_live(canvas, picture, error) : clt_glass_put_live(&self->glass, picture, error);
  if (status == CLT_OK) {
    *shown_ns = show(self, canvas);
  }
  return status;
}

static void close_projector(clt_projector *projector) {
  glfw_projector *self = (glfw_projector *)projector;
  if (self != NULL) {
    clt_canvas_close(self->canvas);
    clt_glass_close(&self->glass);
    clt_screen_close(&self->screen);
    free(self);
  }
}

static const clt_projector_driver driver = {
    .name = "glfw", .describe = describe, .present = present, .close = close_projector, .present_live = present_live};

/* Black goes up first, by which the swaps are timed and the desktop comes to rest; only then is the panel's size known
 * for certain. */
static clt_status start(glfw_projector *self, clt_error *error) {
  const clt_screen *screen = &self->screen;
  double refresh_hz = self->screen.mode.refreshRate > 0    ? self->screen.mode.refreshRate
                      : self->screen.config.refresh_hz > 0 ? self->screen.config.refresh_hz
                                                           : CLT_SWAP_HZ;
  int bits = clt_glass_bits();
  if (bits < 8) {
    return clt_fail(error, CLT_FAILED, "the desktop has %d bits a channel; set its depth to 24", bits);
  }
  clt_swap_open(&self->swap, screen->window, refresh_hz);
  if (!screen->config.window && (screen->width != screen->mode.width || screen->height != screen->mode.height)) {
    clt_log(CLT_LOG_WARNING, "monitor %s has %d x %d pixels, the window %d x %d; set the desktop's scale to 1",
            screen->name, screen->mode.width, screen->mode.height, screen->width, screen->height);
  }
  if (bits == 8 && !self->swap.pacing.throttled && clt_glfw_is_software((const char *)glGetString(GL_RENDERER))) {
    self->canvas = clt_canvas_open(screen->window, screen->width, screen->height);
  }
  return clt_glass_open(screen->width, screen->height, bits > 8 ? 10 : 8, &self->glass, error);
}

clt_status clt_glfw_open_projector(const clt_projector_config *config, clt_projector **out, clt_error *error) {
  glfw_projector *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the projector");
  }
  self->base.driver = &driver;
  clt_status status = clt_screen_open(config, &self->screen, error);
  status = status == CLT_OK ? start(self, error) : status;
  if (status != CLT_OK) {
    close_projector(&self->base);
    return clt_fail_within(error, "projector: ");
  }
  clt_log(CLT_LOG_INFO, "projector: monitor %s, %d x %d pixels of %d bits, %.3f Hz, %s%s", self->screen.name,
          self->glass.width, self->glass.height, self->glass.bits, 1e9 / self->swap.pacing.period_ns,
          clt_swap_method(&self->swap), self->canvas != NULL ? "; painted by the processor" : "");
  *out = &self->base;
  return CLT_OK;
}
