/* Jacobi's product in wavelets (Bai et al. 2010, section 7): S ~ I + W' M W with M sparse (solve/wavelet_form.h),
 * solved by GMRES in coefficients, and corrected by products with T until the tolerance is reached in truth.
 *
 * A solve at the tolerance that was prepared for needs no product with T even to know that it has arrived: a sketch of
 * the residual tells. Omega has one random sign in each column and SKETCH rows, so that E ||Omega r||^2 = ||r||^2
 * (Alon, Matias & Szegedy 1996), and Omega r = Omega b - (Omega S) l takes SKETCH N multiplications. The squared
 * estimate varies like that of SKETCH normal numbers: it falls below 1 / CONFIDENCE^2 of what it estimates once in a
 * thousand residuals, and those that come near are few. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"
#include "solve/refine.h"
#include "solve/wavelet_form.h"
#include "transport/kernels.h"

enum { SKETCH = 32, SKETCH_SEED = 7, WORTH_SHARING = 8192 /* cells from which threads pay */ };
static const double CONFIDENCE = 1.64; /* sqrt(32 / 11.98), the .001 quantile of chi^2 with 32 degrees of freedom */
static const double FORM_SHARE = 0.7, INNER_SHARE = 0.2; /* of the tolerance */
static const double FINEST = 1e-3;                       /* below, products with T are worth more than coefficients */

typedef struct wavelet {
  clt_wavelet_form form;
  size_t cells;
  unsigned char *bucket; /* of each cell: its row of Omega, and SKETCH more where its sign is - */
  float *sketch;         /* Omega S; SKETCH x cells */

  /* of the run that goes on */
  clt_system *system;
  clt_run *run;
} wavelet;

static double sign_of(const wavelet *of, size_t i) {
  return of->bucket[i] < SKETCH ? 1 : -1;
}

/* Omega S, row by row a product with S'. */
static clt_status make_sketch(wavelet *of, clt_system *system, clt_error *error) {
  double *in = clt_alloc(of->cells, 2 * sizeof *in), *out = in + of->cells;
  of->bucket = clt_alloc(of->cells, sizeof *of->bucket);
  of->sketch = clt_alloc(of->cells, SKETCH * sizeof *of->sketch);
  if (in == NULL || of->bucket == NULL || of->sketch == NULL) {
    free(in);
    return clt_fail(error, CLT_FAILED, "wavelet: not enough memory for a sketch of %zu cells", of->cells);
  }
  for (size_t i = 0; i < of->cells; i++) {
    of->bucket[i] = (unsigned char)(clt_random_bits(SKETCH_SEED, i) % (2 * SKETCH));
  }
  for (size_t k = 0; k < SKETCH; k++) {
    for (size_t i = 0; i < of->cells; i++) {
      in[i] = of->bucket[i] % SKETCH == k ? sign_of(of, i) : 0;
    }
    clt_system_apply_transposed(system, in, out);
    for (size_t j = 0; j < of->cells; j++) {
      of->sketch[k * of->cells + j] = (float)out[j];
    }
  }
  free(in);
  return CLT_OK;
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  wavelet *of = *prepared = clt_alloc(1, sizeof *of);
  if (of == NULL) {
    return clt_fail(error, CLT_FAILED, "wavelet: not enough memory");
  }
  of->cells = system->cols;
  double wanted = FORM_SHARE * fmax(system->tolerance, FINEST);
  clt_status status = clt_wavelet_form_init(&of->form, system, wanted, error);
  return status == CLT_OK ? make_sketch(of, system, error) : status;
}

static void release(void *prepared) {
  wavelet *of = prepared;
  if (of == NULL) {
    return;
  }
  clt_wavelet_form_finish(&of->form);
  free(of->bucket);
  free(of->sketch);
  free(of);
}

/* out = c + M c */
static void apply_form(void *context, const double *c, double *out) {
  const wavelet *of = context;
  clt_wavelet_form_apply(&of->form, c, out);
  clt_add(of->cells, 1, c, out);
}

/* d = W' (I + M)^-1 W r, as exactly as the tolerance or the form's error is worth. */
static void apply(void *context, const double *r, double *d) {
  wavelet *of = context;
  clt_system *system = of->system;
  double *c = clt_system_vector(system, CLT_REFINE_VECTORS),
         *scratch = clt_system_vector(system, CLT_REFINE_VECTORS + 1);
  clt_copy(of->cells, r, c);
  clt_d4_forward(&of->form.d4, c, scratch);
  double norm = clt_norm(of->cells, c), enough = INNER_SHARE * clt_run_target(of->run, system);
  clt_gmres gmres = {.apply = apply_form,
                     .context = of,
                     .count = of->cells,
                     .basis = clt_system_vector(system, CLT_REFINE_VECTORS + 2),
                     .stride = system->stride,
                     .target = fmax(enough, INNER_SHARE * of->form.error * norm)};
  clt_run inner = {
      .iteration_limit = CLT_GMRES_STEPS, .start_ns = of->run->start_ns, .deadline_s = of->run->deadline_s};
  memset(d, 0, of->cells * sizeof *d);
  clt_gmres_cycle(&gmres, &inner, c, norm, d);
  clt_d4_inverse(&of->form.d4, d, scratch);
  for (size_t j = 0; j < of->cells; j++) {
    d[j] = system->lit[j] ? d[j] : 0;
  }
}

/* CONFIDENCE ||Omega (b - S l)|| */
static double bound(void *context, const double *l, double norm) {
  (void)norm;
  const wavelet *of = context;
  double left[SKETCH] = {0};
  for (size_t i = 0; i < of->cells; i++) {
    left[of->bucket[i] % SKETCH] += sign_of(of, i) * of->system->wanted[i];
  }
  const clt_plain_kernels *kernels = clt_plain_choose();
#pragma omp parallel for schedule(static) if (of->cells >= WORTH_SHARING)
  for (size_t k = 0; k < SKETCH; k += CLT_PLAIN_ROWS) {
    const float *row[CLT_PLAIN_ROWS];
    double sum[CLT_PLAIN_ROWS];
    for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) {
      row[r] = of->sketch + (k + r) * of->cells;
    }
    kernels->dot_float(row, l, of->cells, sum);
    for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) {
      left[k + r] -= sum[r];
    }
  }
  return CONFIDENCE * clt_norm(SKETCH, left);
}

static clt_outcome run_wavelet(clt_system *system, clt_run *run) {
  wavelet *of = system->prepared;
  clt_inverse inverse = {.apply = apply, .bound = bound, .context = of};
  of->system = system;
  of->run = run;
  return clt_refine(&inverse, system, run);
}

/* Measured on boxes of 320 to 10240 cells: making the form ready takes some 60 operations an entry, a solve in
 * coefficients some hundreds a cell, the more coefficients the more, and each leaves what the form was prepared for. */
static void expect(clt_effort *effort) {
  static const double ENTRY = 60, CELL = 300, STEEPNESS = 0.33;
  double cells = (double)effort->model->cells;
  clt_effort_steady(effort, fmin(fmax(effort->tolerance, FINEST), 0.5));
  clt_effort_take(effort, 1, effort->iterations > 1, CELL * pow(fmax(effort->tolerance, FINEST) / 0.1, -STEEPNESS));
  effort->prepare_s = ENTRY * cells * effort->model->vector_s + SKETCH * effort->model->product_s;
}

const clt_method clt_method_wavelet = {
    .name = "wavelet",
    .summary = "R in Daubechies' D4 wavelets of the grid with its small coefficients left out, iterated there and "
               "corrected by products with T; the fastest at tolerances of a percent, up to 12288 cells",
    .apart = true,
    .invests = true,
    .vectors = CLT_REFINE_VECTORS + 2 + CLT_GMRES_VECTORS,
    .prepare = prepare,
    .release = release,
    .expect = expect,
    .run = run_wavelet,
};
