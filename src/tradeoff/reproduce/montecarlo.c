/* Fig. 11: Monte Carlo over paths of patches, inverse (eq. 47) and forward (eq. 46), with and without a final gather,
 * in the box of Fig. 7. Both are the same estimate with a matrix M of their own: x = M^-1 b is S^-1 l_out with M = S,
 * and S l_d with M = I - A; a final gather is one more product, x = b - (M - I) x'. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>

#include "base/memory.h"
#include "base/random.h"
#include "solve/paths.h"
#include "tradeoff/reproduce/figures.h"
#include "tradeoff/reproduce/view.h"

enum {
  CHANNELS = CLT_VIEW_CHANNELS,
  COUNTS = 7,
  NOISY = 3,
  WAYS = 2,
  ESTIMATES = 2,
  LINES = 3,
  COLUMNS = 3,
  SEED = 46
};
static const int samples[COUNTS] = {1, 3, 10, 30, 100, 300, 1000}; /* NOISY is the report's 30 */

enum { INVERSE, FORWARD };
enum { PLAIN, GATHERED };

/* The divisions of a side, and the largest ladder size up to which each is taken. */
static const struct { int cells, division; } sizes[] = {{5120, 32}, {1280, 16}, {320, 8}, {0, 4}};

/* What the picture shows: line after line; count -1 is the right answer. */
static const struct {
  int way, estimate, count;
} panels[LINES][COLUMNS] = {{{INVERSE, PLAIN, -1}, {INVERSE, PLAIN, NOISY}, {INVERSE, GATHERED, NOISY}},
                            {{INVERSE, PLAIN, 2}, {INVERSE, PLAIN, 4}, {INVERSE, PLAIN, 6}},
                            {{FORWARD, PLAIN, -1}, {FORWARD, PLAIN, NOISY}, {FORWARD, GATHERED, NOISY}}};

typedef struct study {
  clt_cube cube;
  size_t cells;
  double *matrix;                         /* M of the channel and way that is looked at */
  double *right[WAYS];                    /* l_d, l_out: CHANNELS * cells values each */
  double *estimate[ESTIMATES];            /* cells values each */
  double *shown;                          /* LINES * COLUMNS pictures of CHANNELS * cells values */
  double square[WAYS][ESTIMATES][COUNTS]; /* sum over channels and patches of squared errors */
  double light[WAYS];                     /* sum of squares of the right answers */
} study;

static clt_status study_init(study *of, int division, clt_error *error) {
  *of = (study){0};
  clt_status status = clt_cube_init(&of->cube, CLT_VIEW_SIDES, division, division, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t cells = of->cells = of->cube.cells;
  of->matrix = clt_alloc(cells, cells * sizeof *of->matrix);
  of->shown = clt_alloc((size_t)LINES * COLUMNS * CHANNELS * cells, sizeof *of->shown);
  of->right[INVERSE] = clt_alloc((WAYS * CHANNELS + ESTIMATES) * cells, sizeof(double));
  if (of->matrix == NULL || of->shown == NULL || of->right[INVERSE] == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for the paths of %zu patches; ask for a smaller ladder",
                    cells);
  }
  of->right[FORWARD] = of->right[INVERSE] + CHANNELS * cells;
  of->estimate[PLAIN] = of->right[FORWARD] + CHANNELS * cells;
  of->estimate[GATHERED] = of->estimate[PLAIN] + cells;
  return CLT_OK;
}

static void study_finish(study *of) {
  free(of->matrix);
  free(of->shown);
  free(of->right[INVERSE]);
  clt_cube_finish(&of->cube);
}

/* y = b + x - M x */
static void gather(const study *of, const double *b, const double *x, double *y) {
  blasint count = (blasint)of->cells;
  for (size_t i = 0; i < of->cells; i++) {
    y[i] = b[i] + x[i];
  }
  cblas_dgemv(CblasRowMajor, CblasNoTrans, count, count, -1.0, of->matrix, count, x, 1, 1.0, y, 1);
}

static void keep_panels(study *of, int way, int estimate, int count, int channel, const double *light) {
  for (int k = 0; k < LINES * COLUMNS; k++) {
    int line = k / COLUMNS, column = k % COLUMNS;
    if (panels[line][column].way == way && panels[line][column].estimate == estimate &&
        panels[line][column].count == count) {
      memcpy(of->shown + (size_t)(k * CHANNELS + channel) * of->cells, light, of->cells * sizeof *light);
    }
  }
}

/* Draws paths for one channel by the rows of M. */
static clt_status draw(study *of, int way, int channel, clt_error *error) {
  clt_matrix matrix = {.count = of->cells, .entries = of->matrix};
  clt_paths paths = {0};
  const double *b = of->right[way == INVERSE ? FORWARD : INVERSE] + (size_t)channel * of->cells;
  const double *right = of->right[way] + (size_t)channel * of->cells;
  clt_status status = clt_paths_init(&paths, &matrix, "the box is to stay below the limit", error);
  keep_panels(of, way, PLAIN, -1, channel, right);
  for (int k = 0; k < COUNTS && status == CLT_OK; k++) {
    uint64_t key = clt_random_key(SEED, (uint64_t)((way * CHANNELS + channel) * COUNTS + k));
    clt_paths_estimate(&paths, b, samples[k], key, of->estimate[PLAIN], NULL);
    gather(of, b, of->estimate[PLAIN], of->estimate[GATHERED]);
    for (int e = 0; e < ESTIMATES; e++) {
      for (size_t i = 0; i < of->cells; i++) {
        of->square[way][e][k] += pow(of->estimate[e][i] - right[i], 2);
      }
      keep_panels(of, way, e, k, channel, of->estimate[e]);
    }
  }
  for (size_t i = 0; i < of->cells; i++) {
    of->light[way] += right[i] * right[i];
  }
  clt_paths_finish(&paths);
  return status;
}

/* l_d = the albedo of each side, l_out = S l_d; then paths by the rows of S, and by those of I - A. */
static clt_status run_channel(study *of, int channel, clt_error *error) {
  size_t cells = of->cells, each = cells / CLT_VIEW_SIDES;
  blasint count = (blasint)cells;
  const double *albedo = clt_room_view_albedo[channel];
  double *direct = of->right[INVERSE] + (size_t)channel * cells, *seen = of->right[FORWARD] + (size_t)channel * cells;
  clt_status status = clt_cube_solve(&of->cube, albedo, of->matrix, error);
  if (status == CLT_OK) {
    for (size_t i = 0; i < cells; i++) {
      direct[i] = albedo[i / each];
    }
    cblas_dgemv(CblasRowMajor, CblasNoTrans, count, count, 1.0, of->matrix, count, direct, 1, 0.0, seen, 1);
    status = draw(of, INVERSE, channel, error);
  }
  if (status == CLT_OK) {
    for (size_t k = 0; k < cells * cells; k++) {
      of->matrix[k] = (k % (cells + 1) == 0) - albedo[k / cells / each] * of->cube.factors[k];
    }
    status = draw(of, FORWARD, channel, error);
  }
  return status;
}

/* Mean over patches and channels. */
static double variance(const study *of, int way, int estimate, int count) {
  return of->square[way][estimate][count] / (double)(CHANNELS * of->cells);
}

static double rms(const study *of, int way, int estimate, int count) {
  return 100.0 * sqrt(of->square[way][estimate][count] / of->light[way]);
}

static void judge(const study *of, clt_reproduction *out) {
  double slope[WAYS];
  for (int way = 0; way < WAYS; way++) {
    slope[way] = log(variance(of, way, PLAIN, COUNTS - 1) / variance(of, way, PLAIN, 0)) / log(samples[COUNTS - 1]);
  }
  clt_reproduced_add(out, "Fig. 11, variance", "variance falls inversely with the number of samples per pixel",
                     fabs(slope[INVERSE] + 1.0) < 0.1 && fabs(slope[FORWARD] + 1.0) < 0.1,
                     "as samples^%.3f (inverse) and samples^%.3f (forward), 1 to %d samples, N = %zu", slope[INVERSE],
                     slope[FORWARD], samples[COUNTS - 1], of->cells);
  clt_reproduced_add(out, "Fig. 11, final gather",
                     "30 samples, extremely noisy in themselves, give good results with a final gather",
                     rms(of, INVERSE, GATHERED, NOISY) < 0.2 * rms(of, INVERSE, PLAIN, NOISY),
                     "%.0f %% off with 30 samples, %.2f %% with a final gather (forward: %.1f %% and %.2f %%)",
                     rms(of, INVERSE, PLAIN, NOISY), rms(of, INVERSE, GATHERED, NOISY), rms(of, FORWARD, PLAIN, NOISY),
                     rms(of, FORWARD, GATHERED, NOISY));
}

static clt_status plot(const study *of, const char *folder, clt_error *error) {
  static const char *const names[WAYS][ESTIMATES] = {{"inverse", "inverse, gathered"},
                                                     {"forward", "forward, gathered"}};
  enum { GREY = 7, ABOVE = 4 };
  clt_chart chart = {.title = "Variance of Monte Carlo",
                     .across = "samples per patch",
                     .up = "variance of a patch's light",
                     .log_across = true,
                     .log_up = true};
  for (int way = 0; way < WAYS; way++) {
    for (int e = 0; e < ESTIMATES; e++) {
      clt_chart_line *line = clt_chart_add(&chart, "%s", names[way][e]);
      line->colour = way;
      line->dashed = e == GATHERED;
      for (int k = 0; k < COUNTS; k++) {
        clt_chart_point(line, samples[k], variance(of, way, e, k));
      }
    }
  }
  clt_chart_line *line = clt_chart_add(&chart, "falls as 1 / samples");
  line->colour = GREY;
  line->dashed = true;
  for (int k = 0; k < COUNTS; k++) {
    clt_chart_point(line, samples[k], ABOVE * variance(of, INVERSE, PLAIN, 0) / samples[k]);
  }
  return clt_chart_write(&chart, folder, "fig11", error);
}

static clt_status paint(const study *of, const char *folder, clt_error *error) {
  clt_room_view view = {0};
  clt_image strip = {0};
  clt_status status = clt_room_view_init(&view, &of->cube, error);
  if (status == CLT_OK) {
    status = clt_image_init(&strip, CHANNELS, LINES * CLT_VIEW_PIXELS, COLUMNS * CLT_VIEW_PIXELS, error);
  }
  for (int k = 0; k < LINES * COLUMNS && status == CLT_OK; k++) {
    const double *light = of->shown + (size_t)k * CHANNELS * of->cells;
    clt_room_view_paint(&view, light, 0.0, 0.8, k % COLUMNS, k / COLUMNS, &strip);
  }
  if (status == CLT_OK) {
    status = clt_figure_picture(folder, "fig11.png", &strip, error);
  }
  clt_image_finish(&strip);
  clt_room_view_finish(&view);
  return status;
}

static clt_status compute(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  size_t size = 0;
  study of;
  while (options->largest > 0 && sizes[size].cells > options->largest) {
    size++;
  }
  clt_status status = study_init(&of, sizes[size].division, error);
  for (int c = 0; c < CHANNELS && status == CLT_OK; c++) {
    status = clt_figure_step(options, error, "Fig. 11, N = %zu, channel %d of %d", of.cells, c + 1, CHANNELS);
    status = status == CLT_OK ? run_channel(&of, c, error) : status;
  }
  if (status == CLT_OK) {
    judge(&of, out);
    status = plot(&of, options->folder, error);
  }
  if (status == CLT_OK) {
    status = paint(&of, options->folder, error);
  }
  study_finish(&of);
  return status;
}

const clt_figure clt_figure_montecarlo = {
    .name = "Fig. 11",
    .caption =
        "Monte Carlo over paths of patches drawn by importance from the rows of R (inverse, eq. 47 to 50) and, as "
        "its dual, of A (forward, eq. 46), in the box of Fig. 7. A final gather is one product more.",
    .files = {{"fig11.svg", "Mean over patches and channels of the squared error; dashed after a final gather.", false},
              {"fig11.png",
               "Above: the direct light to be found, 30 samples, 30 and a final gather. Middle: 10, 100 and 1000 "
               "samples. Below, forward: the global light to be found, 30 samples, 30 and a final gather.",
               false}},
    .compute = compute};
