/* The model of S that reciprocity allows, and the model of H = S' S that follows from it.
 *
 * With w the flux weights, Z = W^-1/2 S W^1/2 is symmetric (flux.c), so S x = y says Z W^-1/2 x = W^-1/2 y, and S' p =
 * s says Z W^1/2 p = W^1/2 s: a product with T' tells of T as well. Q is an orthonormal basis of all such directions
 * and Y = Z Q. The symmetric matrix nearest to the identity that agrees with Z on Q is (Powell's update, 1970, in
 * blocks)
 *
 *   B = I - Q Q' + Y Q' + Q Y' - Q C Q',   C = Q'Y. */
#include <lapacke.h>
#include <math.h>

#include "solve/bounded.h"

static const double NOTHING_NEW = 1e-9; /* of a direction: what is left of one that the basis holds */

void clt_reciprocal_open(clt_reciprocal *model, const clt_box *box, size_t first) {
  const clt_system *system = box->system;
  model->box = box;
  model->count = model->next = 0;
  model->root = clt_system_vector(system, first);
  model->fresh = clt_system_vector(system, first + 1);
  model->shown = clt_system_vector(system, first + 2);
  model->q = clt_system_vector(system, first + 3);
  model->y = clt_system_vector(system, first + 3 + CLT_SECANTS);
  for (size_t j = 0; j < system->cols; j++) {
    model->root[j] = system->lit[j] ? sqrt(system->flux[j]) : 0;
  }
}

/* out = W^(1/2) in, or W^(-1/2) in; 0 at dark cells. */
static void times_root(const clt_reciprocal *model, const double *in, double *out) {
  for (size_t j = 0; j < model->box->system->cols; j++) {
    out[j] = in[j] * model->root[j];
  }
}

static void by_root(const clt_reciprocal *model, const double *in, double *out) {
  for (size_t j = 0; j < model->box->system->cols; j++) {
    out[j] = model->root[j] > 0 ? in[j] / model->root[j] : 0;
  }
}

/* Takes in Z fresh = shown. A full basis loses its oldest direction: the others agree without it. */
static void take(clt_reciprocal *model) {
  size_t cols = model->box->system->cols, stride = model->box->system->stride;
  double whole = clt_norm(cols, model->fresh);
  int slot = model->next, count = model->count;
  for (int k = 0; k < 2 * count; k++) { /* twice is enough (Kahan; Parlett 1980) */
    size_t at = (size_t)(k % count) * stride;
    double c = k % count == slot ? 0 : clt_dot(cols, model->q + at, model->fresh);
    clt_add(cols, -c, model->q + at, model->fresh);
    clt_add(cols, -c, model->y + at, model->shown);
  }
  double rest = clt_norm(cols, model->fresh);
  if (!(rest > NOTHING_NEW * whole)) {
    return;
  }
  cblas_dscal((blasint)cols, 1 / rest, model->fresh, 1);
  cblas_dscal((blasint)cols, 1 / rest, model->shown, 1);
  clt_copy(cols, model->fresh, model->q + (size_t)slot * stride);
  clt_copy(cols, model->shown, model->y + (size_t)slot * stride);
  model->count = count < CLT_SECANTS ? count + 1 : count;
  model->next = (slot + 1) % CLT_SECANTS;
  for (int k = 0; k < model->count; k++) {
    size_t at = (size_t)k * stride;
    model->core[slot][k] = model->core[k][slot] =
        0.5 * (clt_dot(cols, model->q + at, model->shown) + clt_dot(cols, model->fresh, model->y + at));
  }
}

void clt_reciprocal_learn(clt_reciprocal *model, const double *x, const double *y) {
  by_root(model, x, model->fresh);
  by_root(model, y, model->shown);
  take(model);
}

void clt_reciprocal_learn_transposed(clt_reciprocal *model, const double *p, const double *s) {
  times_root(model, p, model->fresh);
  times_root(model, s, model->shown);
  take(model);
}

/* z = B z for `columns` vectors, stride apart; seen = Y' z before that. */
static void apply_model(const clt_reciprocal *model, int columns, double *z, double *seen) {
  blasint cols = (blasint)model->box->system->cols, stride = (blasint)model->box->system->stride, count = model->count;
  double along[CLT_SECANTS * CLT_SECANTS], mixed[CLT_SECANTS * CLT_SECANTS];
  if (count == 0) {
    return;
  }
  cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, count, columns, cols, 1, model->q, stride, z, stride, 0, along,
              count);
  cblas_dgemm(CblasColMajor, CblasTrans, CblasNoTrans, count, columns, cols, 1, model->y, stride, z, stride, 0, seen,
              count);
  for (int i = 0; i < count * columns; i++) {
    mixed[i] = seen[i] - along[i];
  }
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, count, columns, count, -1, model->core[0], CLT_SECANTS, along,
              count, 1, mixed, count);
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, cols, columns, count, 1, model->q, stride, mixed, count, 1, z,
              stride);
  cblas_dgemm(CblasColMajor, CblasNoTrans, CblasNoTrans, cols, columns, count, 1, model->y, stride, along, count, 1, z,
              stride);
}

/* S' = W^-1/2 Z W^1/2. */
void clt_reciprocal_guess(clt_reciprocal *model, const double *p, double *out) {
  double seen[CLT_SECANTS];
  times_root(model, p, out);
  apply_model(model, 1, out, seen);
  by_root(model, out, out);
}

/* On X = W^1/2 Q the products S X = W^1/2 Y are known, so that X' H X = Y' W Y is exact, and H X = S' W^1/2 Y is
 * W^-1/2 B W Y by the model. With L L' = Y' W Y the pairs X L^-T and H X L^-T are those of clt_secants. */
void clt_reciprocal_tell(clt_reciprocal *model, clt_secants *secants) {
  size_t stride = model->box->system->stride;
  blasint cols = (blasint)model->box->system->cols, count = model->count;
  double *x = secants->v[0], *hx = secants->y[0], factor[CLT_SECANTS * CLT_SECANTS];
  for (int k = 0; k < count; k++) {
    times_root(model, model->q + (size_t)k * stride, x + (size_t)k * stride);
    times_root(model, model->y + (size_t)k * stride, hx + (size_t)k * stride);
    times_root(model, hx + (size_t)k * stride, hx + (size_t)k * stride);
  }
  apply_model(model, count, hx, factor);
  secants->count = 0;
  if (count == 0 || LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', count, factor, count) != 0) {
    return;
  }
  for (int k = 0; k < count; k++) {
    by_root(model, hx + (size_t)k * stride, hx + (size_t)k * stride);
  }
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, cols, count, 1, factor, count, x,
              (blasint)stride);
  cblas_dtrsm(CblasColMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, cols, count, 1, factor, count, hx,
              (blasint)stride);
  secants->count = count;
  for (int k = 0; k < count; k++) {
    for (int i = 0; i <= k; i++) {
      secants->gram[i][k] = secants->gram[k][i] = clt_dot((size_t)cols, x + (size_t)i * stride, x + (size_t)k * stride);
    }
  }
  secants->sigma = fmin(1, 1 / secants->gram[count - 1][count - 1]);
}
