/* One step of the matrix iteration. */
#ifndef CLT_SOLVE_MATRIX_ITERATION_H
#define CLT_SOLVE_MATRIX_ITERATION_H

#include <stddef.h>

/* next = I - R x (Bai et al. 2010, eq. 45); n x n, row-major. Returns ||next - x||_F = ||I - S x||_F. */
double clt_matrix_step(const double *r, const double *x, size_t n, double *next);

#endif
