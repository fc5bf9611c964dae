/* Moving pictures encoded on the processor for glass that takes bytes. */
#ifndef CLT_DEVICE_LIVE_ENCODE_H
#define CLT_DEVICE_LIVE_ENCODE_H

#include "counterlight/device.h"

/* What clt_live_encode and clt_live_dither give of three channels and 8 bits, in one pass: pixels[y * width + x] is
 * 0xRRGGBB of the steps. */
clt_status clt_live_paint(const clt_live_picture *picture, int height, int width, uint32_t *pixels, clt_error *error);

#endif
