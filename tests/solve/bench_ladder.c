/* Time per solve of the report's iteration and of the methods that prepare, in closed boxes of growing resolution (Bai
 * et al. 2010, Fig. 10: to 1 % error, preparation not counted). Usage: bench_ladder [ALBEDO [SIDE...]]; a box of SIDE x
 * SIDE x 3/4 SIDE patches has 5 SIDE^2 cells: sides of 8, 16, 32 make 320, 1280, 5120. */
#include <lapacke.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "solve/method.h"

enum { TIMES_MAX = 15 };
static const double TOLERANCE = 0.01, SECONDS_PER_METHOD = 1.5;

/* A patch: centre, inward normal; all areas are 1 / side^2. */
typedef struct patch {
  double centre[3];
  int axis, sign;
} patch;

typedef struct box {
  size_t side, depth, width, cells; /* patches; the grid is width x side */
} box;

static box box_of(size_t side, size_t depth) {
  size_t width = 2 * side + 4 * depth;
  return (box){side, depth, width, width * side};
}

/* The six faces side by side, `side` rows high: two of side columns, four of depth. */
static void list_patches(box of, patch *patches) {
  const size_t side = of.side, wide[6] = {side, side, of.depth, of.depth, of.depth, of.depth};
  const int axis[6] = {2, 2, 0, 0, 1, 1};
  const double size[3] = {1, 1, (double)of.depth / (double)side};
  size_t left = 0;
  for (int face = 0; face < 6; face++) {
    int u = axis[face] == 2 ? 0 : 2, v = 3 - axis[face] - u;
    for (size_t k = 0; k < side * wide[face]; k++) {
      size_t row = k / wide[face], column = k % wide[face];
      patch *to = &patches[row * of.width + left + column];
      to->axis = axis[face];
      to->sign = face % 2 ? -1 : 1;
      to->centre[axis[face]] = face % 2 ? size[axis[face]] : 0;
      to->centre[u] = ((double)column + .5) / (double)side;
      to->centre[v] = ((double)row + .5) / (double)side;
    }
    left += wide[face];
  }
}

/* cos cos / (pi r^2) */
static double exchange(const patch *a, const patch *b) {
  double square = 0, from = 0, to = 0;
  for (int k = 0; k < 3; k++) {
    double way = b->centre[k] - a->centre[k];
    square += way * way;
    from += k == a->axis ? a->sign * way : 0;
    to -= k == b->axis ? b->sign * way : 0;
  }
  return from > 1e-9 && to > 1e-9 ? from * to / (M_PI * square * square) : 0;
}

/* albedo G with row sums of G 1: a symmetric kernel scaled on both sides (Sinkhorn). */
static void fill_form_factors(size_t n, const patch *patches, double albedo, float *g) {
  double *scale = calloc(n, sizeof *scale);
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t i = 0; i < n; i++) {
    scale[i] = 1;
    for (size_t j = 0; j < n; j++) {
      g[i * n + j] = (float)exchange(&patches[i], &patches[j]);
    }
  }
  for (int pass = 0; pass < 30; pass++) {
    for (size_t i = 0; i < n; i++) {
      double sum = 0;
      for (size_t j = 0; j < n; j++) {
        sum += (double)g[i * n + j] * scale[j];
      }
      scale[i] = sqrt(scale[i] / sum);
    }
  }
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < n; i++) {
    for (size_t j = 0; j < n; j++) {
      g[i * n + j] = (float)(albedo * scale[i] * (double)g[i * n + j] * scale[j]);
    }
  }
  free(scale);
}

/* T = (I - albedo G)^-1, symmetric positive definite, by Cholesky in place. */
static clt_transport *make_box(box of, double albedo, clt_error *error) {
  size_t n = of.cells;
  clt_transport *transport = NULL;
  patch *patches = calloc(n, sizeof *patches);
  if (patches == NULL || clt_transport_create_dense((int)of.width, (int)of.side, 1, n, &transport, error) != CLT_OK) {
    free(patches);
    return NULL;
  }
  float *entries = clt_transport_entries(transport, 0);
  lapack_int size = (lapack_int)n;
  list_patches(of, patches);
  fill_form_factors(n, patches, albedo, entries);
  for (size_t i = 0; i < n * n; i++) {
    entries[i] = (i % (n + 1) == 0 ? 1 : 0) - entries[i];
  }
  bool done = LAPACKE_spotrf(LAPACK_COL_MAJOR, 'U', size, entries, size) == 0 &&
              LAPACKE_spotri(LAPACK_COL_MAJOR, 'U', size, entries, size) == 0;
  for (size_t i = 0; i < n && done; i++) {
    for (size_t j = 0; j < i; j++) {
      entries[j * n + i] = entries[i * n + j];
    }
  }
  free(patches);
  if (!done) {
    clt_fail(error, CLT_FAILED, "the box of side %zu is not positive definite", of.side);
    clt_transport_destroy(transport);
    return NULL;
  }
  return transport;
}

/* A picture: an even part, a gradient, an edge and texture. */
static double picture(box of, size_t i) {
  double x = (double)(i % of.width) / (double)of.width, y = (double)(i / of.width) / (double)of.side;
  return .35 + .25 * sin(9 * x + 4 * y) + (x > .3 && x < .55 ? .25 : 0) + .1 * sin(71 * x) * cos(53 * y);
}

/* One method on one system. */
typedef struct rung {
  const clt_method *method;
  const clt_transport *transport;
  const clt_certificate *certificate;
  const double *wanted, *known;
  double prepare_s, median_s, error, residual;
  long products;
  int iterations;
} rung;

static int compare_numbers(const void *left, const void *right) {
  double a = *(const double *)left, b = *(const double *)right;
  return (a > b) - (a < b);
}

/* Runs it again and again from zero. */
static bool time_runs(rung *of, clt_system *system, double *residual) {
  double times[TIMES_MAX], left = SECONDS_PER_METHOD;
  int count = 0;
  for (; count < TIMES_MAX && (left > 0 || count < 3); count++) {
    clt_system_want(system, of->wanted);
    memset(system->light, 0, system->cols * sizeof *system->light);
    long products = system->products;
    clt_run run = {.tolerance = TOLERANCE,
                   .iteration_limit = 1000,
                   .start_ns = clt_clock_ns(),
                   .radius_high = clt_certificate_channel(of->certificate, 0)->radius_high};
    int64_t start_ns = clt_clock_ns();
    bool done = of->method->run(system, &run) == CLT_RUN_CONVERGED;
    left -= times[count] = clt_clock_since(start_ns);
    of->products = system->products - products;
    of->iterations = run.iterations;
    if (!done) {
      fprintf(stderr, "%s: %s\n", of->method->name, run.note);
      return false;
    }
  }
  qsort(times, (size_t)count, sizeof *times, compare_numbers);
  of->median_s = times[count / 2];
  of->residual = clt_system_residual(system, system->light, residual) / system->wanted_norm;
  double rest = 0, size = 0;
  for (size_t i = 0; i < system->cols; i++) {
    rest += (system->light[i] - of->known[i]) * (system->light[i] - of->known[i]);
    size += of->known[i] * of->known[i];
  }
  of->error = sqrt(rest / size);
  return true;
}

static bool climb(rung *of, clt_error *error) {
  clt_system system = {0};
  void *prepared = NULL;
  double *residual = calloc(clt_transport_describe(of->transport).rows, sizeof *residual);
  bool done = clt_system_init(&system, of->transport, false, error) == CLT_OK;
  system.tolerance = TOLERANCE;
  if (done) {
    clt_system_select(&system, 0, clt_certificate_first_bounce(of->certificate, 0),
                      clt_certificate_lit(of->certificate, 0));
    system.flux = clt_certificate_flux(of->certificate, 0);
    system.reciprocity = clt_certificate_channel(of->certificate, 0)->reciprocity;
    int64_t start_ns = clt_clock_ns();
    done = clt_system_reserve(&system, of->method->vectors, error) == CLT_OK &&
           (of->method->prepare == NULL || of->method->prepare(&system, &prepared, error) == CLT_OK);
    of->prepare_s = clt_clock_since(start_ns);
    system.prepared = prepared;
  }
  done = done && time_runs(of, &system, residual);
  if (of->method->release != NULL) {
    of->method->release(prepared);
  }
  clt_system_finish(&system);
  free(residual);
  return done;
}

static bool measure_box(box room, double albedo, clt_error *error) {
  static const char *const names[] = {"jacobi", "pcg", "stored-inverse", "wavelet"};
  size_t n = room.cells;
  clt_transport *transport = make_box(room, albedo, error);
  clt_certificate *certificate = NULL;
  double *values = calloc(3 * n, sizeof *values), jacobi_s = 0;
  bool done = transport != NULL && values != NULL && clt_certify(transport, &certificate, error) == CLT_OK;
  for (size_t i = 0; i < n && done; i++) {
    values[i] = picture(room, i);
    values[n + i] = values[i] * clt_certificate_first_bounce(certificate, 0)[i];
  }
  if (done) {
    clt_transport_apply(transport, 0, values, values + 2 * n);
  }
  for (size_t m = 0; done && m < sizeof names / sizeof names[0]; m++) {
    rung of = {.method = clt_method_find(names[m]),
               .transport = transport,
               .certificate = certificate,
               .wanted = values + 2 * n,
               .known = values + n};
    done = climb(&of, error);
    jacobi_s = m == 0 ? of.median_s : jacobi_s;
    printf("%6zu  %-15s %9.4f ms  %7.1fx  %5.2f %% error  %5.2f %% residual  %2d iterations  %2ld products  %7.2f s to "
           "prepare\n",
           n, names[m], 1e3 * of.median_s, jacobi_s / of.median_s, 100 * of.error, 100 * of.residual, of.iterations,
           of.products, of.prepare_s);
    fflush(stdout);
  }
  clt_certificate_destroy(certificate);
  clt_transport_destroy(transport);
  free(values);
  return done;
}

int main(int count, char **arguments) {
  static const size_t boxes[][2] = {{8, 6}, {16, 12}, {32, 24}};
  double albedo = count > 1 ? atof(arguments[1]) : .35;
  clt_error error = {0};
  bool done = true;
  printf("albedo %.2f, to 1 %%; times are medians, ratios to jacobi\n", albedo);
  for (int k = 2; k + 1 < count && done; k += 2) {
    done = measure_box(box_of((size_t)atol(arguments[k]), (size_t)atol(arguments[k + 1])), albedo, &error);
  }
  for (size_t k = 0; count <= 2 && k < sizeof boxes / sizeof boxes[0] && done; k++) {
    done = measure_box(box_of(boxes[k][0], boxes[k][1]), albedo, &error);
  }
  if (!done) {
    fprintf(stderr, "bench_ladder: %s\n", error.message);
  }
  return done ? 0 : 1;
}
