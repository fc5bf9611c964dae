/* Shows what was drawn, at the screen's pace, and says when it appears. The window's GL context is current. */
#ifndef CLT_DEVICE_PROJECTOR_SWAP_H
#define CLT_DEVICE_PROJECTOR_SWAP_H

#include <stdbool.h>
#include <stdint.h>

#include "device/projector/canvas.h"
#include "device/projector/pacing.h"

/* Where neither the mode nor the configuration says a rate. */
#define CLT_SWAP_HZ 60.0

typedef struct clt_swap {
  struct GLFWwindow *window;
  bool stamps; /* the display tells when swaps take place */
  clt_pacing pacing;
} clt_swap;

/* Learns how the screen paces swaps, by showing black for a quarter of a second or so. */
void clt_swap_open(clt_swap *swap, struct GLFWwindow *window, double refresh_hz);
/* Shows what was drawn, or what stands on the canvas where that is not NULL. Returns when the refresh that first shows
 * it starts. */
int64_t clt_swap_show(clt_swap *swap, clt_canvas *canvas);
/* Lets a refresh pass without showing anything, by the clock; returns when it starts. */
int64_t clt_swap_pass(clt_swap *swap);
/* Where the times come from, for the log. */
const char *clt_swap_method(const clt_swap *swap);

#endif
