/* The inner loops of encoding a row of a moving picture: portable C, and the same for instructions that this processor
 * may have. No fused operations, so that the bits of a code do not depend on the processor. */
#ifndef CLT_DEVICE_LIVE_KERNELS_H
#define CLT_DEVICE_LIVE_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/image.h"

enum { CLT_LIVE_COLOURS = 3, CLT_LIVE_PAD = 16 };

/* One piece of a function that is linear piece by piece: value + part step, part in 0..1. Both come with one load. */
typedef struct clt_live_piece {
  float value, step;
} clt_live_piece;

/* The codes of a panel over light, in pieces that are short where responses are steep: 2^FINE to each octave of light +
 * 2^-OCTAVES. Their ends are where the bits of such a number have zeros behind the first FINE of its fraction. Codes
 * are right to 1e-5 where responses are powers of light down to 1 / 3.2. */
enum { CLT_LIVE_OCTAVES = 20, CLT_LIVE_FINE = 6, CLT_LIVE_PIECES = (CLT_LIVE_OCTAVES << CLT_LIVE_FINE) + 1 };
void clt_live_tabulate(const clt_curve *response, clt_live_piece piece[CLT_LIVE_PIECES]);

/* A field along a row of the panel, as it is on the two rows of cells that the row lies between. */
typedef struct clt_live_field {
  const float *upper, *lower;
} clt_live_field;

typedef struct clt_live_row_kernels {
  const char *needs; /* what the processor must have; NULL: nothing */
  bool (*runs_here)(void);
  /* plane[c * count + x] = codes[3 x + c] */
  void (*split)(const uint8_t *codes, size_t count, uint8_t *plane);
  /* out[x] = own[at[x]] + part[x] (own[at[x] + 1] - own[at[x]]), at ascending; CLT_LIVE_PAD numbers behind the last
   * that is named can be read */
  void (*expand)(const float *own, const int32_t *at, const float *part, size_t count, float *out);
  /* out[x] = value + part[x] step of piece at[x] */
  void (*interpolate)(const clt_live_piece *piece, const int32_t *at, const float *part, size_t count, float *out);
  /* drive[x] = gain light[x] + offset, clipped to 0..1 (NaN is dark); fields at `down` of the way from upper to lower
   */
  void (*drive)(const clt_live_field *gain, const clt_live_field *offset, float down, const float *light, size_t count,
                float *drive);
  /* Where light, 0..1, lies among the pieces of a response: at[x] + part[x]. */
  void (*place)(const float *light, size_t count, int32_t *at, float *part);
  /* codes[k] to steps of 1 / full, up where what is lost exceeds 1 - u, u of start + k (clt_live_dither) */
  void (*dither)(float *codes, size_t count, float full, uint32_t start);
  /* pixels[x] = 0xRRGGBB: the steps to which dither brings codes[c][x], full 255, from start[c] on */
  void (*paint)(const float *const codes[CLT_LIVE_COLOURS], const uint32_t start[CLT_LIVE_COLOURS], size_t count,
                uint32_t *pixels);
} clt_live_row_kernels;

/* Every variant, the fastest first, ended by the portable one and NULL; and the first that runs here. */
extern const clt_live_row_kernels *const clt_live_row_variants[];
const clt_live_row_kernels *clt_live_row_choose(void);

#endif
