/* R in the square D4 wavelets of the grid, on both sides, with its small coefficients left out.
 *
 *   R ~ W' M W,   W orthonormal (solve/daubechies.h), M sparse
 *
 * M is held in that one basis rather than split level by level (Beylkin, Coifman & Rokhlin 1991), and the basis is that
 * of the grid's two dimensions rather than of its cells in a row: docs/solving.md has the counts that decided. */
#ifndef CLT_SOLVE_WAVELET_FORM_H
#define CLT_SOLVE_WAVELET_FORM_H

#include <stdint.h>

#include "solve/daubechies.h"
#include "solve/system.h"

/* The rows of M stand in slices of rows that hold about as many coefficients (the longest first), the k-th of each side
 * by side, so that a product neither waits for sums nor guesses where a row ends. Zeros fill up the shorter ones. */
enum { CLT_WAVELET_SLICE = 8 };

typedef struct clt_wavelet_form {
  clt_d4 d4;
  size_t cells; /* of the grid, and rows and columns of M */
  size_t kept;  /* coefficients */
  size_t slices;
  size_t *first;    /* place at which a slice begins; slices + 1 values */
  uint32_t *row;    /* of each place in a slice: its row of M; `cells` behind the last; slices * CLT_WAVELET_SLICE */
  uint16_t *column; /* of each place; first[slices] */
  float *value;
  double dropped; /* Frobenius norm of what is left out: ||R x - W' M W x|| <= dropped ||x||, up to float's rounding */
  double error;   /* the worst ||R z - W' M W z|| / ||z|| over the probes z */
} clt_wavelet_form;

/* Transforms R of the selected channel and leaves out as many of its small coefficients as keep `error` at most
 * `wanted`, in magnitude steps of a quarter of an octave. The probes are 1 and random signs on blocks of 1, 2, 4, ..
 * cells. CLT_BAD_INPUT beyond CLT_MATRIX_CELLS_MAX cells. The caller zeroed the form, and finishes it in either case.
 */
clt_status clt_wavelet_form_init(clt_wavelet_form *form, const clt_system *system, double wanted, clt_error *error);
void clt_wavelet_form_finish(clt_wavelet_form *form);
/* out = M c, both in coefficients. */
void clt_wavelet_form_apply(const clt_wavelet_form *form, const double *c, double *out);

#endif
