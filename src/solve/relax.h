/* Relaxation, cell by cell: what gauss-seidel, sor and southwell share.
 *
 * Relaxing cell j by delta = omega r_j / S_jj changes l_j by delta and the residual by -delta times column j of S. So
 * the residual of every moment is known without further products, a sweep reads each entry once, and the deadline can
 * end a sweep anywhere. */
#ifndef CLT_SOLVE_RELAX_H
#define CLT_SOLVE_RELAX_H

#include "solve/iterate.h"
#include "solve/matrix.h"

/* What is kept of a system: S over lit cells, column after column. */
typedef struct clt_relaxation {
  clt_matrix matrix; /* entries[j * count + i] = S_ij */
} clt_relaxation;

clt_status clt_relax_prepare(clt_system *system, const char *method, void **prepared, clt_error *error);
void clt_relax_release(void *prepared);

/* CLT_BAD_INPUT where nothing promises convergence. For a reciprocal transport S = M W^-1 with M symmetric positive
 * definite (pcg.c), and every 0 < omega < 2 converges, as does relaxing the largest residual first (Ostrowski 1954;
 * Southwell: each step lowers the energy). Else R >= 0 with rho(R) < 1 makes S an H-matrix, which serves for omega up
 * to 1 at least (Varga 1962). */
clt_status clt_relax_check(const char *method, const clt_channel_certificate *channel, clt_error *error);

/* What a sweep over the entries costs, and making them ready. */
void clt_relax_expect(clt_effort *effort);

enum { CLT_RELAX_VECTORS = 3 };
typedef struct clt_relax_state {
  clt_system *system;
  const clt_relaxation *kept;
  double *l, *full, *r; /* l and full over all cells, r over lit cells */
} clt_relax_state;

/* Relaxes lit cell number k. */
void clt_relax_cell(clt_relax_state *state, size_t k, double omega);
/* An iteration: at most one relaxation for each lit cell; ends early when the deadline has come. */
typedef void clt_relax_sweep(clt_relax_state *state, clt_run *run, double omega);
/* Every lit cell in its order. */
void clt_relax_in_order(clt_relax_state *state, clt_run *run, double omega);
clt_outcome clt_relax_run(clt_system *system, clt_run *run, clt_relax_sweep *sweep, double omega);

#endif
