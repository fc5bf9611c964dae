#include "solve/model.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "base/order.h"
#include "base/random.h"

static const double COMPLETE = 1e-12; /* a Krylov space is, where a step leaves this share of a product */
enum { PICTURE_SEED = 11 };

static double median(double *times, int count) {
  clt_sort_doubles(times, (size_t)count);
  return times[count / 2];
}

/* b: a picture in which every value from 0 to 1 comes as often, over lit cells. Returns their number. */
static size_t draw_picture(const clt_system *system, double *b) {
  size_t lit = 0;
  for (size_t i = 0; i < system->cols; i++) {
    b[i] = system->lit[i] ? clt_random_uniform(PICTURE_SEED, i) : 0;
    lit += system->lit[i] != 0;
  }
  return lit;
}

/* v_(k+1) = S v_k made orthogonal to v_0..v_k, twice; false where nothing is left of it. */
static bool extend(clt_system *system, clt_model *model, int k, double *vector_s) {
  double *next = clt_system_vector(system, (size_t)k + 1);
  double whole = clt_norm(system->cols, next);
  int64_t start_ns = clt_clock_ns();
  for (int pass = 0; pass < 2; pass++) {
    for (int i = 0; i <= k; i++) {
      double part = clt_dot(system->cols, clt_system_vector(system, (size_t)i), next);
      clt_add(system->cols, -part, clt_system_vector(system, (size_t)i), next);
      model->h[i][k] += part;
    }
  }
  *vector_s = clt_clock_since(start_ns) / (4.0 * (k + 1));
  double length = model->h[k + 1][k] = clt_norm(system->cols, next);
  if (!(length > COMPLETE * whole)) {
    model->h[k + 1][k] = 0;
    return false;
  }
  cblas_dscal((blasint)system->cols, 1 / length, next, 1);
  return true;
}

void clt_model_build(clt_system *system, clt_model *model) {
  double products[CLT_MODEL_STEPS], vectors[CLT_MODEL_STEPS];
  double *first = clt_system_vector(system, 0);
  bool goes_on = true;
  *model = (clt_model){.cells = draw_picture(system, first)};
  if (model->cells == 0) {
    return;
  }
  cblas_dscal((blasint)system->cols, 1 / clt_norm(system->cols, first), first, 1);
  while (goes_on && model->steps < CLT_MODEL_STEPS) {
    int k = model->steps++;
    int64_t start_ns = clt_clock_ns();
    clt_system_apply(system, clt_system_vector(system, (size_t)k), clt_system_vector(system, (size_t)k + 1));
    products[k] = clt_clock_since(start_ns);
    goes_on = extend(system, model, k, &vectors[k]);
  }
  model->product_s = median(products, model->steps);
  model->vector_s = median(vectors, model->steps);
}

/* out = H in */
static void apply(const clt_model *model, const double *in, double *out) {
  for (int i = 0; i < model->steps; i++) {
    out[i] = 0;
    for (int j = i > 0 ? i - 1 : 0; j < model->steps; j++) {
      out[i] += model->h[i][j] * in[j];
    }
  }
}

static void begin(clt_effort *effort, double *r) {
  effort->iterations = 0;
  effort->residual = 1;
  for (int i = 0; i < CLT_MODEL_STEPS; i++) {
    r[i] = i == 0;
  }
}

static bool goes_on(const clt_effort *effort) {
  return effort->residual > effort->tolerance && effort->iterations < effort->limit && isfinite(effort->residual);
}

static void count(clt_effort *effort, double residual) {
  effort->iterations++;
  effort->residual = residual;
}

void clt_effort_richardson(clt_effort *effort, double omega) {
  double r[CLT_MODEL_STEPS], s[CLT_MODEL_STEPS];
  size_t steps = (size_t)effort->model->steps;
  begin(effort, r);
  while (goes_on(effort)) {
    apply(effort->model, r, s);
    clt_add(steps, -omega, s, r);
    count(effort, clt_norm(steps, r));
  }
}

void clt_effort_chebyshev(clt_effort *effort, double m) {
  double r[CLT_MODEL_STEPS], d[CLT_MODEL_STEPS], s[CLT_MODEL_STEPS], rho = m;
  size_t steps = (size_t)effort->model->steps;
  begin(effort, r);
  for (size_t i = 0; i < steps; i++) {
    d[i] = (1 - m * m) * r[i];
  }
  while (goes_on(effort)) {
    double next = m / (2 - m * rho), keep = next * rho, take = m > 0 ? 2 * next * (1 - m * m) / m : 1;
    apply(effort->model, d, s);
    for (size_t i = 0; i < steps; i++) {
      r[i] -= s[i];
      d[i] = keep * d[i] + take * r[i];
    }
    rho = next;
    count(effort, clt_norm(steps, r));
  }
}

/* h_(k+1,k) |y_k| for H_k y = e_0: what the Galerkin condition leaves after k steps. */
static double galerkin_residual(const clt_model *model, int k) {
  double matrix[CLT_MODEL_STEPS * CLT_MODEL_STEPS], y[CLT_MODEL_STEPS] = {1};
  lapack_int pivots[CLT_MODEL_STEPS];
  for (int i = 0; i < k; i++) {
    for (int j = 0; j < k; j++) {
      matrix[i * k + j] = i <= j + 1 ? model->h[i][j] : 0;
    }
  }
  return LAPACKE_dgesv(LAPACK_ROW_MAJOR, k, 1, matrix, k, pivots, y, 1) == 0 ? model->h[k][k - 1] * fabs(y[k - 1])
                                                                             : INFINITY;
}

/* The residuals go on falling as they did over the last half of the steps. */
static void extrapolate(clt_effort *effort, double middle) {
  int half = effort->model->steps - effort->model->steps / 2;
  double factor = pow(effort->residual / middle, 1.0 / half);
  while (goes_on(effort)) {
    count(effort, factor < 1 ? effort->residual * factor : effort->residual);
  }
}

/* The least residual rho and Galerkin's g are tied by 1 / rho_k^2 = sum over j <= k of 1 / g_j^2 (Cullum & Greenbaum,
 * SIAM J. Matrix Anal. Appl. 17, 1996). */
void clt_effort_krylov(clt_effort *effort, bool least) {
  double r[CLT_MODEL_STEPS], sum = 1, middle = 1;
  int steps = effort->model->steps;
  begin(effort, r);
  for (int k = 1; k <= steps && goes_on(effort); k++) {
    double galerkin = galerkin_residual(effort->model, k);
    sum += 1 / (galerkin * galerkin);
    count(effort, least ? 1 / sqrt(sum) : galerkin);
    middle = k == steps / 2 ? effort->residual : middle;
  }
  if (steps == CLT_MODEL_STEPS) {
    extrapolate(effort, middle);
  }
}

/* out = H' in */
static void apply_transposed(const clt_model *model, const double *in, double *out) {
  for (int j = 0; j < model->steps; j++) {
    out[j] = 0;
    for (int i = 0; i < model->steps && i <= j + 1; i++) {
      out[j] += model->h[i][j] * in[i];
    }
  }
}

void clt_effort_normal(clt_effort *effort) {
  double r[CLT_MODEL_STEPS], s[CLT_MODEL_STEPS], p[CLT_MODEL_STEPS], q[CLT_MODEL_STEPS];
  size_t steps = (size_t)effort->model->steps;
  begin(effort, r);
  apply_transposed(effort->model, r, s);
  clt_copy(steps, s, p);
  double gamma = clt_dot(steps, s, s);
  while (goes_on(effort) && gamma > 0) {
    apply(effort->model, p, q);
    clt_add(steps, -gamma / clt_dot(steps, q, q), q, r);
    apply_transposed(effort->model, r, s);
    double before = gamma;
    gamma = clt_dot(steps, s, s);
    for (size_t i = 0; i < steps; i++) {
      p[i] = s[i] + gamma / before * p[i];
    }
    count(effort, clt_norm(steps, r));
  }
}

void clt_effort_steady(clt_effort *effort, double factor) {
  double r[CLT_MODEL_STEPS], bounded = fmin(fmax(factor, 0), 1); /* 1 where it is not known */
  begin(effort, r);
  while (goes_on(effort)) {
    count(effort, bounded * effort->residual);
  }
}

/* The cell that a sweep relaxes as its k-th: in order, or the one with the largest residual. */
static size_t next_cell(const double *r, size_t cells, size_t k, bool largest_first) {
  return largest_first ? cblas_idamax((blasint)cells, r, 1) : k;
}

/* With A = m / 5 between faces, S over the faces' means is (1 + m / 5)^-1 but for the flat mode's (1 - m)^-1. Cells on
 * a face take their share of that; columns are scaled to S_ii = 1. */
void clt_effort_sweeps(clt_effort *effort, double omega, bool largest_first) {
  enum { FACES = 6, FACE = 16, CELLS = FACES * FACE };
  double low = effort->channel->radius_low, high = effort->channel->radius_high;
  double rho = isfinite(high) ? (low + high) / 2 : low, m = rho / (1 + rho), r[CELLS];
  double rest = 1 / (1 + m / (FACES - 1)), apart = (1 / (1 - m) - rest) / FACES / FACE;
  double near = apart + (rest - 1) / FACE, scale = 1 / (1 + near);
  for (size_t i = 0; i < CELLS; i++) {
    r[i] = clt_random_uniform(PICTURE_SEED, i);
  }
  double size = clt_norm(CELLS, r);
  effort->iterations = 0;
  effort->residual = 1;
  while (goes_on(effort)) {
    for (size_t k = 0; k < CELLS; k++) {
      size_t i = next_cell(r, CELLS, k, largest_first);
      double delta = omega * r[i];
      for (size_t j = 0; j < CELLS; j++) {
        r[j] -= delta * (j == i ? 1 : scale * (j / FACE == i / FACE ? near : apart));
      }
    }
    count(effort, clt_norm(CELLS, r) / size);
  }
}

void clt_effort_take(clt_effort *effort, double start_products, double products, double vectors) {
  const clt_model *model = effort->model;
  effort->start_s = start_products * model->product_s;
  effort->iteration_s = products * model->product_s + vectors * model->vector_s;
}

/* Multiplications and additions a second of LAPACK's kernels on this machine. */
static double measure_flops(void) {
  enum { SIDE = 192, REPEATS = 3 };
  double *a = clt_alloc(3 * SIDE * SIDE, sizeof *a), best = 1e-2;
  for (int k = 0; k < REPEATS && a != NULL; k++) {
    int64_t start_ns = clt_clock_ns();
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, SIDE, SIDE, SIDE, 1, a, SIDE, a + SIDE * SIDE, SIDE, 0,
                a + 2 * SIDE * SIDE, SIDE);
    best = fmin(best, clt_clock_since(start_ns));
  }
  free(a);
  return 2.0 * SIDE * SIDE * SIDE / best;
}

void clt_effort_prepare(clt_effort *effort, double flops) {
  static const double PASSES = 4; /* over the entries: reading, scaling, writing, moving */
  double cells = (double)effort->model->cells;
  effort->prepare_s += PASSES * cells * effort->model->vector_s + (flops > 0 ? flops / measure_flops() : 0);
}
