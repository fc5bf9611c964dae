#include "tradeoff/reproduce/cube.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "sim/exchange.h"

/* The walls of the unit cube, fronts inwards. */
static const struct {
  clt_vector corner, u, v;
} walls[CLT_CUBE_SIDES] = {
    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},   {{0, 0, 0}, {0, 1, 0}, {0, 0, 1}},   {{1, 1, 1}, {-1, 0, 0}, {0, 0, -1}},
    {{1, 1, 1}, {0, 0, -1}, {0, -1, 0}}, {{1, 1, 1}, {0, -1, 0}, {-1, 0, 0}}, {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}},
};

static size_t patches_of_a_side(const clt_cube *cube) {
  return (size_t)cube->columns * (size_t)cube->rows;
}

static void divide(clt_cube *cube, const clt_rectangle *sides, int *surface) {
  size_t each = patches_of_a_side(cube);
  for (size_t k = 0; k < cube->cells; k++) {
    const clt_rectangle *whole = &sides[k / each];
    clt_rectangle *part = &cube->patches[k];
    int number = (int)(k % each);
    *part = *whole;
    part->u = vec_scale(1.0 / cube->columns, whole->u);
    part->v = vec_scale(1.0 / cube->rows, whole->v);
    part->corner = vec_along(whole->corner, number % cube->columns, part->u, number / cube->columns, part->v);
    surface[k] = (int)(k / each);
  }
}

/* H, given above the diagonal column-major, to form factors in place: G_ij = H_ij / area, all areas being the same. */
static void spread_factors(clt_cube *cube) {
  size_t count = cube->cells;
  double area = clt_rectangle_area(&cube->patches[0]);
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t j = 0; j < count; j++) {
    for (size_t i = 0; i < j; i++) {
      double factor = cube->factors[j * count + i] / area;
      cube->factors[j * count + i] = cube->factors[i * count + j] = factor;
    }
    cube->factors[j * count + j] = 0.0;
  }
}

static clt_status exchange(clt_cube *cube, const clt_rectangle *sides, const int *surface, clt_error *error) {
  clt_visibility *visibility = NULL;
  clt_status status = clt_visibility_create(sides, cube->sides, &visibility, error);
  if (status == CLT_OK) {
    clt_parts parts = {sides, cube->patches, surface, cube->sides, (int)cube->cells, visibility};
    status = clt_exchange_compute(&parts, cube->factors, error);
  }
  clt_visibility_destroy(visibility);
  return status;
}

clt_status clt_cube_init(clt_cube *cube, int sides, int columns, int rows, clt_error *error) {
  clt_rectangle faces[CLT_CUBE_SIDES] = {0};
  *cube = (clt_cube){.sides = sides, .columns = columns, .rows = rows};
  cube->cells = (size_t)sides * patches_of_a_side(cube);
  for (int k = 0; k < sides; k++) {
    faces[k] = (clt_rectangle){.corner = walls[k].corner, .u = walls[k].u, .v = walls[k].v};
    clt_rectangle_complete(&faces[k]);
  }
  cube->patches = clt_alloc(cube->cells, sizeof *cube->patches);
  cube->factors = clt_alloc(cube->cells * cube->cells, sizeof *cube->factors);
  int *surface = clt_alloc(cube->cells, sizeof *surface);
  clt_status status = CLT_OK;
  if (!cube->patches || !cube->factors || !surface) {
    status = clt_fail(error, CLT_FAILED, "not enough memory for a box of %zu patches", cube->cells);
  } else {
    divide(cube, faces, surface);
    status = exchange(cube, faces, surface, error);
  }
  free(surface);
  if (status == CLT_OK) {
    spread_factors(cube);
  }
  return status;
}

void clt_cube_finish(clt_cube *cube) {
  free(cube->patches);
  free(cube->factors);
  *cube = (clt_cube){0};
}

static double albedo_at(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], size_t cell) {
  return albedo[cell / patches_of_a_side(cube)];
}

/* With equal areas G is symmetric: I - A = D (I - D G D) D^-1 for D = diag(sqrt(albedo)), so
 * S = I + D ((I - D G D)^-1 - I) D^-1, where A = 0 leaves the row of a black patch as it is. */
clt_status clt_cube_solve(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], double *operator,
                          clt_error * error) {
  size_t count = cube->cells;
  double least = 1e-12; /* keeps D invertible; it moves S by as much */
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < count; i++) {
    double scale = sqrt(fmax(albedo_at(cube, albedo, i), least));
    for (size_t j = 0; j < count; j++) {
      double other = sqrt(fmax(albedo_at(cube, albedo, j), least));
      operator[i * count + j] =(i == j) - scale * other * cube->factors[i * count + j];
    }
  }
  lapack_int size = (lapack_int)count;
  lapack_int failed = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', size, operator, size);
  failed = failed != 0 ? failed : LAPACKE_dpotri(LAPACK_COL_MAJOR, 'L', size, operator, size);
  if (failed != 0) {
    return clt_fail(error, CLT_FAILED, "the light of a box could not be solved (LAPACK says %d)", (int)failed);
  }
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t j = 0; j < count; j++) {
    double scale = sqrt(fmax(albedo_at(cube, albedo, j), least));
    for (size_t i = j + 1; i < count; i++) {
      double other = sqrt(fmax(albedo_at(cube, albedo, i), least)), value = operator[j * count + i];
      operator[i * count + j] = value * other / scale;
      operator[j * count + i] = value * scale / other;
    }
  }
  return CLT_OK;
}

clt_status clt_cube_transport(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], clt_transport **out,
                              clt_error *error) {
  size_t count = cube->cells, each = patches_of_a_side(cube), columns = (size_t)cube->columns;
  int width = cube->sides * cube->columns;
  double *operator= clt_alloc(count *count, sizeof *operator);
  if (operator== NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for the light of %zu patches", count);
  }
  clt_status status = clt_cube_solve(cube, albedo, operator, error);
  if (status == CLT_OK) {
    status = clt_transport_create_dense(width, cube->rows, 1, count, out, error);
  }
  float *entries = status == CLT_OK ? clt_transport_entries(*out, 0) : NULL;
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < count; i++) {
    size_t row = i % each / columns * (size_t)width + i / each * columns + i % columns;
    for (size_t j = 0; entries != NULL && j < count; j++) {
      size_t column = j % each / columns * (size_t)width + j / each * columns + j % columns;
      entries[row * count + column] = (float)operator[i * count + j];
    }
  }
  free(operator);
  return status;
}

void clt_cube_bounce(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], const double *x, double *y) {
  cblas_dgemv(CblasRowMajor, CblasNoTrans, (blasint)cube->cells, (blasint)cube->cells, 1.0, cube->factors,
              (blasint)cube->cells, x, 1, 0.0, y, 1);
  for (size_t i = 0; i < cube->cells; i++) {
    y[i] *= albedo_at(cube, albedo, i);
  }
}

void clt_cube_illuminate(const clt_cube *cube, const double albedo[CLT_CUBE_SIDES], double *x, double *scratch) {
  enum { BOUNCES_MAX = 100000 };
  static const double NOTHING = 1e-17;
  double *bounce = scratch, *next = scratch + cube->cells, most = 1.0, first = 0.0;
  cblas_dcopy((blasint)cube->cells, x, 1, bounce, 1);
  for (int k = 0; k < BOUNCES_MAX && most > NOTHING * first; k++) {
    clt_cube_bounce(cube, albedo, bounce, next);
    most = 0.0;
    for (size_t i = 0; i < cube->cells; i++) {
      bounce[i] = next[i];
      x[i] += next[i];
      most = fmax(most, fabs(next[i]));
    }
    first = fmax(first, most);
  }
}
