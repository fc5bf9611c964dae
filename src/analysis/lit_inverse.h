/* T^-1 over the cells that the projector lights. */
#ifndef CLT_ANALYSIS_LIT_INVERSE_H
#define CLT_ANALYSIS_LIT_INVERSE_H

#include "counterlight/transport.h"

typedef struct clt_lit_inverse {
  size_t count;    /* lit cells */
  size_t *cell;    /* of each, its number in the grid, ascending */
  double *entries; /* T_ll^-1, count x count row-major */
} clt_lit_inverse;

/* By LAPACK from the entries of T. CLT_BAD_INPUT for more than CLT_EXACT_CELLS_MAX lit cells and where there is no
 * inverse. The caller zeroed *inverse, and finishes it in either case. */
clt_status clt_lit_inverse_init(clt_lit_inverse *inverse, const clt_transport *transport, int channel,
                                const unsigned char *lit, clt_error *error);
void clt_lit_inverse_finish(clt_lit_inverse *inverse);

#endif
