/* The flux of drive cells, from the reciprocity of blocks. */
#ifndef CLT_ACQUIRE_FLUX_FIT_H
#define CLT_ACQUIRE_FLUX_FIT_H

#include "acquire/partition.h"

/* Fits flux[j] = exp(a polynomial of second degree in the place of cell j), mean 1, so that the light blocks give each
 * other is reciprocal: with X_ab = sum over i in a of w_i C_ib, X_ab = X_ba for every pair of blocks (NUMERICS section
 * 1). A projector's pixels differ by the cube of a cosine at most, which such a polynomial follows to 1e-3. columns[b]
 * holds block b's far light (channels x cells). Cells with dark[j] take no part and get flux 0. CLT_FAILED where memory
 * is short. */
clt_status clt_fit_flux(const clt_partition *partition, float *const *columns, const unsigned char *dark, float *flux,
                        clt_error *error);

#endif
