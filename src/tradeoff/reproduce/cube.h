/* The report's box: a unit cube of 2 to 6 diffuse sides with analytic form factors (Bai et al. 2010, section 6). */
#ifndef CLT_REPRODUCE_CUBE_H
#define CLT_REPRODUCE_CUBE_H

#include "counterlight/transport.h"
#include "sim/geometry.h"

enum { CLT_CUBE_SIDES = 6 };

typedef struct clt_cube {
  int sides, columns, rows; /* each side is divided into columns x rows patches */
  size_t cells;             /* sides * columns * rows: side after side, row after row */
  clt_rectangle *patches;
  double *factors; /* G: cells x cells row-major, factors[i * cells + j] the form factor from patch i to j */
} clt_cube;

/* Sides in this order, so that fewer leave the room more open: floor, left, back, right, ceiling, front. cube was
 * zeroed by the caller and is finished by it in either case. */
clt_status clt_cube_init(clt_cube *cube, int sides, int columns, int rows, clt_error *error);
void clt_cube_finish(clt_cube *cube);

/* S = (I - A)^-1 with A_ij = albedo_i G_ij, by Cholesky's factor of the symmetrised I - A, into operator (cells x cells
 * row-major). albedo: of each side. */
clt_status clt_cube_solve(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], double *operator,
                          clt_error * error);
/* T = S in one channel: every patch is lit by a drive cell of its own, with F = I. The grid has a row of patches of
 * each side after the other: width = sides * columns, height = rows. */
clt_status clt_cube_transport(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], clt_transport **out,
                              clt_error *error);

/* y = A x. */
void clt_cube_bounce(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], const double *x, double *y);
/* x <- (I - A)^-1 x, by the forward iteration (eq. 41) until nothing changes; albedo < 1. scratch: 2 * cells values. */
void clt_cube_illuminate(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], double *x, double *scratch);

#endif
