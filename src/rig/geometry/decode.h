/* Structured light to a pixel map.
 *
 * A picture less its inverse is A E_b(x): A the projector's direct light at the pixel, E_b the blurred profile of bit b
 * at its panel coordinate x. Light that comes by way of other surfaces sees both pictures of fine stripes alike and
 * drops out. With s the noise, per pixel and axis:
 *   1. A = largest |difference| of the wider bits; A under a few s is unlit.
 *   2. The blur of a tile of 64 x 64 pixels follows from how fast the fine bits fade (clt_blurs_fit).
 *   3. Bits that blur leaves above the noise are taken by sign. Where the pixel is not at an edge of theirs they must
 *      have their full height: one near zero is ambiguous, one far below it is lit from two places (Xu & Aliaga,
 * "Robust pixel classification for 3D modeling with structured light", GI 2007, for the notion).
 *   4. x is the mean over the likelihood of all fine differences in the code's cell and its neighbours, as far as the
 *      panel reaches, A being what suits each place best: light of wide stripes by way of other surfaces is in the A of
 *      step 1. That comes to the cell's middle where stripes are sharp and to interpolated zero crossings where they
 * are soft. Then refine.h puts pixels in line with their neighbours. */
#ifndef CLT_RIG_GEOMETRY_DECODE_H
#define CLT_RIG_GEOMETRY_DECODE_H

#include "rig/geometry/pairs.h"
#include "rig/geometry/pixel_map.h"

/* What decoding found beside the map. */
typedef struct clt_decode_report {
  long count[CLT_PIXEL_FATES];
  long ambiguous[2][CLT_GRAY_BITS_MAX]; /* pixels ambiguous at a bit of an axis */
  double blur[2];                       /* median over tiles, panel pixels */
  double pitch;                         /* panel pixels from one camera pixel to the next, median of both axes */
  double noise;                         /* of a pixel's difference, median over lit pixels, fraction of full scale */
} clt_decode_report;

/* Decodes a complete sequence. map is initialised here. detail[y * width + x]: of an ambiguous pixel
 * axis * CLT_GRAY_BITS_MAX + bit. CLT_FAILED where memory is short; a picture of nothing gives an empty map. */
clt_status clt_decode(const clt_pairs *pairs, clt_pixel_map *map, uint8_t *detail, clt_decode_report *report,
                      clt_error *error);

#endif
