/* Fig. 7: the inverse series on a box with a red and a green wall, seen from its open front. Above, what n terms make
 * of the light; below, the terms themselves, where neutral grey is 0. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "tradeoff/reproduce/figures.h"
#include "tradeoff/reproduce/view.h"

enum { DIVISION = 16, SHOWN = 9, CHANNELS = CLT_VIEW_CHANNELS, SIDES = CLT_VIEW_SIDES };

/* One channel's series: estimate and term hold n terms; the next are filled in place. */
static void add_term(const clt_cube *cube, int channel, double *estimate, double *term, double *scratch) {
  double *lit = scratch + 2 * cube->cells;
  memcpy(lit, term, cube->cells * sizeof *lit);
  clt_cube_illuminate(cube, clt_room_view_albedo[channel], lit, scratch);
  for (size_t i = 0; i < cube->cells; i++) {
    term[i] -= lit[i];
    estimate[i] += term[i];
  }
}

static double relative_error(const double *estimate, const double *direct, size_t values) {
  double error = 0.0, whole = 0.0;
  for (size_t k = 0; k < values; k++) {
    error += (estimate[k] - direct[k]) * (estimate[k] - direct[k]);
    whole += direct[k] * direct[k];
  }
  return sqrt(error / whole);
}

/* Mean error over all patches of a channel. */
static double mean_error(const clt_cube *cube, const double *estimate, const double *direct) {
  double sum = 0.0;
  for (size_t i = 0; i < cube->cells; i++) {
    sum += estimate[i] - direct[i];
  }
  return sum / (double)cube->cells;
}

/* direct, estimate and term: CHANNELS * cells values each; scratch: 3 * cells. */
static void run_series(const clt_cube *cube, const clt_room_view *view, double *direct, double *scratch,
                       clt_image *strip, clt_reproduction *out) {
  size_t cells = cube->cells, values = CHANNELS * cells;
  double *estimate = direct + values, *term = estimate + values, before = 0.0, error = 1.0;
  bool alternates = true;
  int needed = -1;
  for (int c = 0; c < CHANNELS; c++) {
    double *of = estimate + (size_t)c * cells;
    for (size_t i = 0; i < cells; i++) {
      direct[(size_t)c * cells + i] = of[i] = clt_room_view_albedo[c][i / (cells / SIDES)];
    }
    clt_cube_illuminate(cube, clt_room_view_albedo[c], of, scratch);
  }
  memcpy(term, estimate, values * sizeof *term);
  clt_room_view_paint(view, direct, 0.0, 0.8, 0, 0, strip);
  clt_room_view_paint(view, direct, 0.5, 0.0, 0, 1, strip);
  for (int n = 0; n < SHOWN - 1; n++) {
    double now = mean_error(cube, estimate, direct);
    alternates = alternates && (n == 0 || now * before < 0.0);
    before = now;
    error = relative_error(estimate, direct, values);
    needed = needed < 0 && error < 0.02 ? n : needed;
    clt_room_view_paint(view, estimate, 0.0, 0.8, n + 1, 0, strip);
    clt_room_view_paint(view, term, n > 0 ? 0.5 : 0.0, n > 0 ? 1.0 : 0.8, n + 1, 1, strip);
    for (int c = 0; c < CHANNELS; c++) {
      add_term(cube, c, estimate + (size_t)c * cells, term + (size_t)c * cells, scratch);
    }
  }
  clt_reproduced_add(out, "Fig. 7", "oscillates between over- and under-compensation, converges after 4-8 iterations",
                     alternates && needed >= 0 && needed <= 8,
                     "the mean error %s sign with every term; below 2 %% after %d, %.2f %% after %d",
                     alternates ? "changes" : "does not change", needed, 100.0 * error, SHOWN - 2);
}

static clt_status compute(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_cube cube = {0};
  clt_room_view view = {0};
  clt_image strip = {0};
  double *vectors = NULL;
  clt_status status = clt_cube_init(&cube, SIDES, DIVISION, DIVISION, error);
  if (status == CLT_OK) {
    status = clt_room_view_init(&view, &cube, error);
  }
  if (status == CLT_OK) {
    vectors = clt_alloc((3 * CHANNELS + 3) * cube.cells, sizeof *vectors);
    status = vectors != NULL ? clt_image_init(&strip, CHANNELS, 2 * CLT_VIEW_PIXELS, SHOWN * CLT_VIEW_PIXELS, error)
                             : clt_fail(error, CLT_FAILED, "not enough memory for a box of %zu patches", cube.cells);
  }
  if (status == CLT_OK) {
    run_series(&cube, &view, vectors, vectors + 3 * CHANNELS * cube.cells, &strip, out);
    status = clt_figure_picture(options->folder, "fig7.png", &strip, error);
  }
  clt_image_finish(&strip);
  free(vectors);
  clt_room_view_finish(&view);
  clt_cube_finish(&cube);
  return status;
}

const clt_figure clt_figure_cornell = {
    .name = "Fig. 7",
    .caption = "The inverse series on a box with a red and a green wall. Above: the direct light, then what comes of "
               "0, 1, 2 ... terms. Below: each term; grey is 0, cyan and magenta take bled red and green away.",
    .files = {{"fig7.png", "From left to right: the direct light, and 0 to 7 terms.", true}},
    .compute = compute};
