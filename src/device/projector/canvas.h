/* The picture on the glass where the processor draws anyway: painted into memory that the X server shares (MIT-SHM),
 * past GL, which would take twice as long for it. */
#ifndef CLT_DEVICE_PROJECTOR_CANVAS_H
#define CLT_DEVICE_PROJECTOR_CANVAS_H

#include "counterlight/device.h"

struct GLFWwindow;

typedef struct clt_canvas clt_canvas;

/* For a window of width x height pixels; NULL where there can be none: on Wayland, on a server that is elsewhere or
 * shares no memory, and where a pixel is not 8 bits of red, green and blue each in a word. */
clt_canvas *clt_canvas_open(struct GLFWwindow *window, int width, int height);
void clt_canvas_close(clt_canvas *canvas); /* accepts NULL; the window is still there */
/* Paints a picture as clt_projector_driver's present: codes are rounded to the nearest step. */
void clt_canvas_put(clt_canvas *canvas, const float *codes);
/* The same for a moving picture: exactly clt_live_encode and clt_live_dither. */
clt_status clt_canvas_put_live(clt_canvas *canvas, const clt_live_picture *picture, clt_error *error);
/* Shows what was painted, in one piece; returns when the server has done so and the canvas may be painted again. */
void clt_canvas_show(clt_canvas *canvas);

#endif
