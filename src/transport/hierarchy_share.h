/* Far light of all channels by one pair of factors.
 *
 * Light that bounces goes by the same geometry in every colour (NUMERICS section 5: A_c = K_c G), so that what the
 * channels take up and give out spans nearly one space. With U and V orthonormal bases of both spaces, T_c far =
 * W^-1 U C_c V' W^-1, C_c of the size of the rank: one U and V to read for all channels, and three small C_c. No
 * Lambertian room is assumed; how many columns are needed says whether it pays. */
#ifndef CLT_TRANSPORT_HIERARCHY_SHARE_H
#define CLT_TRANSPORT_HIERARCHY_SHARE_H

#include <stddef.h>

#include "counterlight/status.h"

/* Far light of one channel by its singular values, W T_c W = left diag(value) right'. Matrices lie column by column. */
typedef struct clt_singular {
  size_t nodes, count;
  double *left, *right; /* nodes x count, orthonormal */
  double *value;        /* count, descending */
} clt_singular;

/* The bases, and each channel's C. rank 0: they do not pay. */
typedef struct clt_shared {
  size_t rank;
  double *left, *right; /* nodes x rank */
  float *core;          /* channels x rank x rank, row by row */
} clt_shared;

/* The least rank, in steps of `step` and at most `most`, at which what a channel has above its tolerance is off by no
 * more than that (in the spectral norm: times the drive's norm); singular values up to the tolerance take no part. The
 * caller finishes out, also after a failure (CLT_FAILED). */
clt_status clt_singular_share(const clt_singular *of, size_t channels, const double *tolerance, size_t step,
                              size_t most, clt_shared *out, clt_error *error);
void clt_shared_finish(clt_shared *shared);

#endif
