#include "device/projector/canvas.h"

#define GLFW_INCLUDE_NONE
#define GLFW_EXPOSE_NATIVE_X11
#include <GLFW/glfw3.h>
#include <GLFW/glfw3native.h>
#include <stdlib.h>
#include <sys/ipc.h>
#include <sys/shm.h>
#include <X11/extensions/XShm.h>
#include <X11/Xutil.h>

#include "base/memory.h"
#include "device/live_encode.h"
#include "device/projector/codes.h"

/* A GLFW for Wayland only, which has the same soname, lacks these. */
#pragma weak glfwGetX11Display
#pragma weak glfwGetX11Window

struct clt_canvas {
  int width, height;
  Display *display;
  Window window;
  GC context;
  XImage *image;          /* NULL: not made */
  XShmSegmentInfo shared; /* its memory */
  bool attached;          /* the server has it too */
};

/* Words of 0xRRGGBB in this machine's own order. */
static bool has_plain_words(const XImage *image) {
  const int own_order = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? LSBFirst : MSBFirst;
  return image->red_mask == 0xFF0000 && image->green_mask == 0xFF00 && image->blue_mask == 0xFF &&
         image->bits_per_pixel == 32 && image->bytes_per_line == 4 * image->width && image->byte_order == own_order;
}

static int ignore(Display *display, XErrorEvent *event) {
  (void)display;
  (void)event;
  return 0;
}

/* True where the server has the memory too. It does not answer to attaching, but to what it is then asked for: a pixel
 * of the screen. */
static bool attach(clt_canvas *canvas) {
  Display *display = canvas->display;
  const int screen = DefaultScreen(display);
  XImage *pixel = XShmCreateImage(display, DefaultVisual(display, screen), (unsigned)DefaultDepth(display, screen),
                                  ZPixmap, canvas->shared.shmaddr, &canvas->shared, 1, 1);
  if (pixel == NULL) {
    return false;
  }
  XSync(display, False);
  XErrorHandler before = XSetErrorHandler(ignore);
  bool attached = XShmAttach(display, &canvas->shared) &&
                  XShmGetImage(display, RootWindow(display, screen), pixel, 0, 0, AllPlanes);
  XSync(display, False);
  XSetErrorHandler(before);
  pixel->data = NULL;
  XDestroyImage(pixel);
  return attached;
}

/* Gives the image its memory, which goes by itself when both have let go of it. */
static bool share(clt_canvas *canvas) {
  const size_t bytes = (size_t)canvas->image->bytes_per_line * (size_t)canvas->height;
  canvas->shared.shmid = shmget(IPC_PRIVATE, bytes, IPC_CREAT | 0600);
  if (canvas->shared.shmid < 0) {
    return false;
  }
  void *memory = shmat(canvas->shared.shmid, NULL, 0);
  if (memory != (void *)-1) {
    canvas->shared.shmaddr = canvas->image->data = memory;
    canvas->attached = attach(canvas);
  }
  shmctl(canvas->shared.shmid, IPC_RMID, NULL);
  return canvas->attached;
}

/* False where there can be none. */
static bool set_up(clt_canvas *canvas) {
  XWindowAttributes about;
  if (!XShmQueryExtension(canvas->display) || !XGetWindowAttributes(canvas->display, canvas->window, &about)) {
    return false;
  }
  canvas->image = XShmCreateImage(canvas->display, about.visual, (unsigned)about.depth, ZPixmap, NULL, &canvas->shared,
                                  (unsigned)canvas->width, (unsigned)canvas->height);
  if (canvas->image == NULL || !has_plain_words(canvas->image) || !share(canvas)) {
    return false;
  }
  canvas->context = XCreateGC(canvas->display, canvas->window, 0, NULL);
  return canvas->context != NULL;
}

clt_canvas *clt_canvas_open(struct GLFWwindow *window, int width, int height) {
  Display *display = glfwGetX11Display != NULL ? glfwGetX11Display() : NULL;
  clt_canvas *canvas = display != NULL ? clt_alloc(1, sizeof *canvas) : NULL;
  if (canvas == NULL) {
    return NULL;
  }
  *canvas = (clt_canvas){.width = width, .height = height, .display = display, .window = glfwGetX11Window(window)};
  if (!set_up(canvas)) {
    clt_canvas_close(canvas);
    return NULL;
  }
  return canvas;
}

void clt_canvas_close(clt_canvas *canvas) {
  if (canvas == NULL) {
    return;
  }
  if (canvas->context != NULL) {
    XFreeGC(canvas->display, canvas->context);
  }
  if (canvas->attached) {
    XShmDetach(canvas->display, &canvas->shared);
    XSync(canvas->display, False);
  }
  if (canvas->image != NULL) {
    canvas->image->data = NULL;
    XDestroyImage(canvas->image);
  }
  if (canvas->shared.shmaddr != NULL) {
    shmdt(canvas->shared.shmaddr);
  }
  free(canvas);
}

/* Of the canvas's memory, which nobody else writes. */
static uint32_t *pixels_of(clt_canvas *canvas) {
  return (void *)canvas->image->data;
}

void clt_canvas_put(clt_canvas *canvas, const float *codes) {
  clt_codes_to_pixels(codes, (size_t)canvas->width * (size_t)canvas->height, pixels_of(canvas));
}

clt_status clt_canvas_put_live(clt_canvas *canvas, const clt_live_picture *picture, clt_error *error) {
  return clt_live_paint(picture, canvas->height, canvas->width, pixels_of(canvas), error);
}

void clt_canvas_show(clt_canvas *canvas) {
  XShmPutImage(canvas->display, canvas->window, canvas->context, canvas->image, 0, 0, 0, 0, (unsigned)canvas->width,
               (unsigned)canvas->height, False);
  XSync(canvas->display, False);
}
