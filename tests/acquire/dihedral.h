/* The transport of two perpendicular unit walls, by point-to-point form factors: T = rho (I - rho G)^-1 for projector
 * cells of equal flux density. Independent of the simulator. */
#ifndef CLT_TESTS_ACQUIRE_DIHEDRAL_H
#define CLT_TESTS_ACQUIRE_DIHEDRAL_H

#include <lapacke.h>

#include "support.h"

/* Form factor from cell i to cell j, each the middle of a subdivided patch: cells of column < width / 2 lie on the wall
 * x = 0 at distance y = (width / 2 - column - 1/2) h from the crease, the others on the wall y = 0. Each patch is
 * divided s x s, more finely where the cells are near. */
static inline double dihedral_factor(int width, int height, int i, int j) {
  int half = width / 2, ci = i % width, cj = j % width;
  if ((ci < half) == (cj < half)) {
    return 0;
  }
  double du = 1.0 / half, dv = 1.0 / height; /* along the wall away from the crease, and up */
  double ui = (ci < half ? half - ci - 0.5 : ci - half + 0.5) * du;
  double uj = (cj < half ? half - cj - 0.5 : cj - half + 0.5) * du;
  double vij = (i / width - j / width) * dv;
  int s = ui + uj < 6 * du && fabs(vij) < 6 * dv ? 4 : 1;
  double sum = 0;
  for (int k = 0; k < s * s * s * s; k++) {
    double a = ui + ((k % s + 0.5) / s - 0.5) * du, b = uj + ((k / s % s + 0.5) / s - 0.5) * du;
    double v = vij + ((k / (s * s) % s + 0.5) / s - (k / (s * s * s) + 0.5) / s) * dv;
    double r2 = a * a + b * b + v * v;
    /* cosines at right angles: the distance of the other point from the crease over r */
    sum += a * b / (M_PI * r2 * r2);
  }
  return sum / (s * s * s * s) * du * dv;
}

/* T of width x height cells, row-major; freed by free(). Cells of equal area make G symmetric and I - rho G positive
 * definite: LAPACK inverts it by Cholesky. */
static inline double *dihedral_transport(int width, int height, double albedo) {
  int cells = width * height;
  double *transport = calloc((size_t)cells * (size_t)cells, sizeof *transport);
  for (int i = 0; i < cells; i++) {
    for (int j = 0; j <= i; j++) {
      double factor = dihedral_factor(width, height, i, j);
      transport[(size_t)i * (size_t)cells + (size_t)j] = (i == j) - albedo * factor;
    }
  }
  assert_int_equal(LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', cells, transport, cells), 0);
  assert_int_equal(LAPACKE_dpotri(LAPACK_ROW_MAJOR, 'L', cells, transport, cells), 0);
  for (size_t i = 0; i < (size_t)cells; i++) {
    for (size_t j = 0; j <= i; j++) {
      double entry = albedo * transport[i * (size_t)cells + j];
      transport[i * (size_t)cells + j] = transport[j * (size_t)cells + i] = entry;
    }
  }
  return transport;
}

/* Direct light and the first bounce only, albedo (I + albedo G), which is cheap on large grids. */
static inline double *dihedral_first_bounce(int width, int height, double albedo) {
  int cells = width * height;
  double *transport = calloc((size_t)cells * (size_t)cells, sizeof *transport);
  for (int i = 0; i < cells; i++) {
    for (int j = 0; j < cells; j++) {
      transport[(size_t)i * (size_t)cells + (size_t)j] =
          albedo * ((i == j) + albedo * dihedral_factor(width, height, i, j));
    }
  }
  return transport;
}

#endif
