/* Pictures of 8-bit sRGB codes, as films deliver them, in linear light on another grid. */
#ifndef CLT_IMAGE_CELL_MEANS_H
#define CLT_IMAGE_CELL_MEANS_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"

/* means[(c * height + y) * width + x] = mean of the linear light of content, which is stretched over the whole grid,
 * over the area of cell (x, y), for the channels c = R, G, B. content[(y * content_width + x) * 3 + c]. */
clt_status clt_cell_means(const uint8_t *content, int content_width, int content_height, int width, int height,
                          float *means, clt_error *error);
/* The other way: codes[3 k + c] of the light[c * count + k], rounded. */
void clt_srgb_codes(const float *light, size_t count, uint8_t *codes);

#endif
