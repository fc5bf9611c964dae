/* Fig. 9: the report's iteration on a scene with shadows and on a glossy one. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "tradeoff/reproduce/shown.h"

enum { PANELS = 3 };
static const double WANTED = 0.01;

/* ||l - l_d|| / ||l_d|| of the answer over lit cells, with l = F x. */
static double light_error(const clt_shown *shown) {
  double error = 0.0, whole = 0.0;
  for (int c = 0; c < shown->info.channels; c++) {
    const double *first_bounce = clt_certificate_first_bounce(shown->certificate, c);
    const unsigned char *lit = clt_certificate_lit(shown->certificate, c);
    for (size_t j = 0; j < shown->info.cols; j++) {
      size_t k = (size_t)c * shown->info.cols + j;
      double wanted = lit[j] ? first_bounce[j] * shown->drive[k] : 0.0;
      double off = lit[j] ? first_bounce[j] * shown->answer[k] - wanted : 0.0;
      error += off * off;
      whole += wanted * wanted;
    }
  }
  return sqrt(error / whole);
}

/* Iterations of eq. 43 until the direct light is known to 1 %; -1 where it does not converge. */
static clt_status count_iterations(const clt_shown *shown, int *iterations, clt_error *error) {
  double tolerance = WANTED, found = INFINITY;
  clt_status status = CLT_OK;
  *iterations = -1;
  for (int try = 0; try < 6 && found > WANTED && status == CLT_OK; try++, tolerance *= 0.5) {
    clt_solve_options options = {.method = "jacobi", .tolerance = tolerance};
    clt_solve_result result;
    status = clt_solve(shown->transport, shown->certificate, shown->light, &options, shown->answer, &result, error);
    found = status == CLT_OK ? light_error(shown) : found;
    *iterations = status == CLT_OK && found <= WANTED ? result.iterations : -1;
  }
  return status;
}

/* What is seen, what the iteration recovers, and the direct light that it is to recover, side by side. */
static clt_status draw(const clt_shown *shown, const char *folder, const char *file, clt_error *error) {
  size_t picture = shown->info.cols * (size_t)shown->info.channels;
  double *values = clt_alloc(PANELS * picture, sizeof *values);
  clt_image strip = {0};
  if (values == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: not enough memory", file);
  }
  for (size_t k = 0; k < picture; k++) {
    int channel = (int)(k / shown->info.cols);
    size_t j = k % shown->info.cols;
    bool lit = clt_certificate_lit(shown->certificate, channel)[j];
    double first_bounce = lit ? clt_certificate_first_bounce(shown->certificate, channel)[j] : 0.0;
    values[k] = shown->light[k];
    values[picture + k] = first_bounce * shown->answer[k];
    values[2 * picture + k] = first_bounce * shown->drive[k];
  }
  clt_status status = clt_shown_strip(shown, values, PANELS, &strip, error);
  if (status == CLT_OK) {
    status = clt_figure_picture(folder, file, &strip, error);
  }
  clt_image_finish(&strip);
  free(values);
  return status;
}

static clt_status recover(const clt_reproduce_options *options, const char *scene, const char *name, const char *report,
                          int most, clt_reproduction *out, clt_error *error) {
  char file[64];
  clt_shown shown;
  int iterations = -1;
  clt_status status = clt_shown_open(options, scene, &shown, error);
  if (status == CLT_OK) {
    for (size_t k = 0; k < shown.info.cols * (size_t)shown.info.channels; k++) {
      size_t row = k % shown.info.cols / (size_t)shown.info.width, column = k % (size_t)shown.info.width;
      shown.drive[k] = (row / 4 + column / 4) % 2 == 0 ? 0.9 : 0.3;
    }
    clt_transport_apply_all(shown.transport, shown.drive, shown.light);
    status = count_iterations(&shown, &iterations, error);
  }
  if (status == CLT_OK) {
    const clt_channel_certificate *channel = clt_certificate_channel(shown.certificate, 0);
    clt_reproduced_add(out, name, report, iterations >= 0 && iterations <= most,
                       "%s.cfg: %d iterations to 1 %%; rho(R) in [%.2f, %.2f], reciprocity defect %.1g", scene,
                       iterations, channel->radius_low, channel->radius_high, channel->reciprocity);
    snprintf(file, sizeof file, "fig9-%s.png", scene);
    status = draw(&shown, options->folder, file, error);
  }
  clt_shown_close(&shown);
  return status;
}

static clt_status compute(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_status status =
      recover(options, "shadow", "Fig. 9, shadowed", "the iteration recovers l_d in 10 iterations", 10, out, error);
  return status != CLT_OK
             ? status
             : recover(options, "glossy", "Fig. 9, glossy", "it recovers l_d in 20 iterations", 20, out, error);
}

const clt_figure clt_figure_scenes = {
    .name = "Fig. 9",
    .caption = "The report's iteration (eq. 43) beyond diffuse boxes: shadows, and walls that shine. The scenes are "
               "this project's own; the report does not describe its.",
    .files = {{"fig9-shadow.png", "Shadows: what is seen, the direct light that the iteration finds, and the true one.",
               true},
              {"fig9-glossy.png", "Gloss: the same.", true}},
    .compute = compute};
