/* Figs. 12 and 13: a picture taken apart bounce by bounce, and what eq. 51 makes of the later bounces. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "counterlight/analysis.h"
#include "tradeoff/reproduce/shown.h"

enum { SHOWN = 4, PANELS = SHOWN + 3, BOUNCES = 8, GREEN = 1 };

static clt_status take_apart(const clt_shown *shown, const clt_interreflection_options *how, clt_bounces *bounces,
                             clt_error *error) {
  clt_interreflection *room = NULL;
  clt_status status = clt_interreflection_create(shown->transport, shown->certificate, how, &room, error);
  if (status == CLT_OK) {
    status = clt_bounces_of_drive(room, shown->drive, BOUNCES, bounces, error);
  }
  clt_interreflection_destroy(room);
  return status;
}

static size_t picture_values(const clt_shown *shown) {
  return shown->info.cols * (size_t)shown->info.channels;
}

/* The picture, its direct light, all that came back, and the first bounces, side by side. strip is initialised here. */
static clt_status lay_out(const clt_shown *shown, const clt_bounces *bounces, clt_image *strip, clt_error *error) {
  size_t picture = picture_values(shown);
  double *values = clt_alloc(PANELS * picture, sizeof *values);
  if (values == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for %d pictures", PANELS);
  }
  memcpy(values, bounces->picture, picture * sizeof *values);
  memcpy(values + picture, bounces->light, picture * sizeof *values);
  for (size_t i = 0; i < picture; i++) {
    values[2 * picture + i] = bounces->picture[i] - bounces->light[i];
  }
  memcpy(values + 3 * picture, bounces->light + picture, SHOWN * picture * sizeof *values);
  clt_status status = clt_shown_strip(shown, values, PANELS, strip, error);
  free(values);
  return status;
}

/* A strip of one channel in the light of another colour. */
static clt_status tint(const clt_image *strip, int channel, clt_image *coloured, clt_error *error) {
  clt_status status = clt_image_init(coloured, 3, strip->height, strip->width, error);
  size_t picture = (size_t)strip->height * (size_t)strip->width;
  for (size_t i = 0; i < picture && status == CLT_OK; i++) {
    coloured->data[(size_t)channel * picture + i] = strip->data[i];
  }
  return status;
}

/* The share of the magnitude of bounce k that lies on the wall where it should not be: even ones belong to the left. */
static double on_wrong_wall(const clt_shown *shown, const clt_bounces *bounces, int k) {
  size_t picture = picture_values(shown), width = (size_t)shown->info.width;
  double wrong = 0.0, all = 0.0;
  for (size_t i = 0; i < picture; i++) {
    double value = fabs(bounces->light[(size_t)k * picture + i]);
    bool left = i % width < width / 2;
    wrong += left == (k % 2 == 0) ? 0.0 : value;
    all += value;
  }
  return wrong / all;
}

static void judge_walls(const clt_shown *shown, const clt_bounces *bounces, clt_reproduction *out) {
  double wrong[SHOWN + 1], worst = 0.0, all = 0.0;
  for (int k = 0; k <= SHOWN; k++) {
    wrong[k] = 100.0 * on_wrong_wall(shown, bounces, k);
    worst = fmax(worst, wrong[k]);
    all += wrong[k] * bounces->figures[k].share;
  }
  clt_reproduced_add(out, "Fig. 12, walls", "successive bounces alternate perfectly between the two walls", worst < 1.0,
                     "%.2f, %.2f, %.2f, %.2f %% of bounces 1 to 4 on the wrong wall, %.3f %% of all light", wrong[1],
                     wrong[2], wrong[3], wrong[4], all);
  clt_reproduced_add(out, "Fig. 12, sum", "each run of the algorithm yields a bounce of light transport",
                     bounces->sum_error < 1e-6, "direct light, bounces and rest sum to the picture to %.0e",
                     bounces->sum_error);
}

/* ||rough - fine|| / ||fine|| of bounce k. */
static double distance(const clt_bounces *rough, const clt_bounces *fine, size_t values, int k) {
  double off = 0.0, whole = 0.0;
  for (size_t i = (size_t)k * values; i < (size_t)(k + 1) * values; i++) {
    off += pow(rough->light[i] - fine->light[i], 2);
    whole += pow(fine->light[i], 2);
  }
  return sqrt(off / whole);
}

/* Both ways to a bounce by solves that stop at 0.1 %, against bounces by fine ones; F = diag(T) in all three. */
static clt_status compare_ways(const clt_shown *shown, double *by_sums, double *by_products, clt_error *error) {
  static const clt_interreflection_options coarse = {.tolerance = 1e-3};
  clt_interreflection *room = NULL;
  clt_bounces rough = {0}, fine = {0};
  clt_status status = take_apart(shown, NULL, &fine, error);
  if (status == CLT_OK) {
    status = clt_interreflection_create(shown->transport, shown->certificate, &coarse, &room, error);
  }
  if (status == CLT_OK) {
    status = clt_bounces_of_drive(room, shown->drive, BOUNCES, &rough, error);
  }
  if (status == CLT_OK) {
    status = clt_bounces_compare_sums(room, &fine, by_sums, error);
  }
  for (int k = 1; k <= BOUNCES && status == CLT_OK; k++) {
    by_products[k] = distance(&rough, &fine, picture_values(shown), k);
  }
  clt_bounces_finish(&rough);
  clt_bounces_finish(&fine);
  clt_interreflection_destroy(room);
  return status;
}

static clt_status judge_cancellation(const clt_shown *shown, const char *folder, clt_reproduction *out,
                                     clt_error *error) {
  clt_chart chart = {
      .title = "Error of each bounce, solves to 0.1 %", .across = "bounce", .up = "relative error", .log_up = true};
  double by_sums[BOUNCES + 1], by_products[BOUNCES + 1], worst = 0.0;
  clt_status status = compare_ways(shown, by_sums, by_products, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_chart_line *sums = clt_chart_add(&chart, "eq. 51"), *products = clt_chart_add(&chart, "A times the last, here");
  for (int k = 1; k <= BOUNCES; k++) {
    clt_chart_point(sums, k, by_sums[k]);
    clt_chart_point(products, k, by_products[k]);
    worst = fmax(worst, by_products[k]);
  }
  clt_reproduced_add(
      out, "Fig. 12, eq. 51", "bounce k is l_d - S^-1 times the sum of the bounces before it",
      worst < 0.01 && by_sums[BOUNCES] > 10.0 * by_products[BOUNCES],
      "by solves to 0.1 %% bounce %d is %.3g %% off that way, %.2f %% (worst of 8: %.2f %%) as A times the "
      "bounce before",
      BOUNCES, 100.0 * by_sums[BOUNCES], 100.0 * by_products[BOUNCES], 100.0 * worst);
  return clt_chart_write(&chart, folder, "fig12-eq51", error);
}

static clt_status draw_green(const clt_shown *shown, const clt_bounces *bounces, const char *folder, clt_error *error) {
  clt_image strip = {0}, green = {0};
  clt_status status = lay_out(shown, bounces, &strip, error);
  if (status == CLT_OK) {
    status = tint(&strip, GREEN, &green, error);
  }
  if (status == CLT_OK) {
    status = clt_figure_picture(folder, "fig12.png", &green, error);
  }
  clt_image_finish(&strip);
  clt_image_finish(&green);
  return status;
}

/* Light on the left half of the white dihedral. */
static clt_status alternate(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_interreflection_options how = {.exact_first_bounce = true};
  clt_shown shown;
  clt_bounces bounces = {0};
  clt_status status = clt_shown_open(options, "book", &shown, error);
  if (status == CLT_OK) {
    size_t width = (size_t)shown.info.width;
    for (size_t j = 0; j < shown.info.cols; j++) {
      shown.drive[j] = j % width < width / 2 ? 1.0 : 0.0;
    }
    status = take_apart(&shown, &how, &bounces, error);
  }
  if (status == CLT_OK) {
    judge_walls(&shown, &bounces, out);
    status = judge_cancellation(&shown, options->folder, out, error);
  }
  if (status == CLT_OK) {
    status = draw_green(&shown, &bounces, options->folder, error);
  }
  clt_bounces_finish(&bounces);
  clt_shown_close(&shown);
  return status;
}

/* Value at a cell over the mean of those three to five cells away, in the second channel. */
static double contrast(const clt_shown *shown, const double *light, size_t cell) {
  int width = shown->info.width, height = shown->info.height, column = (int)cell % width, row = (int)cell / width;
  double sum = 0.0;
  int count = 0;
  for (int y = row - 4; y <= row + 4; y++) {
    for (int x = column - 4; x <= column + 4; x++) {
      bool around = abs(x - column) > 2 || abs(y - row) > 2;
      if (around && x >= 0 && y >= 0 && x < width && y < height) {
        sum += light[shown->info.cols + (size_t)(y * width + x)];
        count++;
      }
    }
  }
  return light[shown->info.cols + cell] / (sum / count);
}

static clt_status draw_highlight(const clt_shown *shown, const clt_bounces *bounces, const char *folder,
                                 clt_error *error) {
  clt_image strip = {0};
  clt_status status = lay_out(shown, bounces, &strip, error);
  if (status == CLT_OK) {
    status = clt_figure_picture(folder, "fig13.png", &strip, error);
  }
  clt_image_finish(&strip);
  return status;
}

/* The ball's highlight is where it outshines its surroundings most. */
static clt_status keep_highlight_direct(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_shown shown;
  clt_bounces bounces = {0};
  clt_status status = clt_shown_open(options, "highlight", &shown, error);
  if (status == CLT_OK) {
    for (size_t k = 0; k < picture_values(&shown); k++) {
      shown.drive[k] = 1.0;
    }
    status = take_apart(&shown, NULL, &bounces, error);
  }
  if (status == CLT_OK) {
    size_t picture = picture_values(&shown), brightest = 0;
    for (size_t j = 0; j < shown.info.cols; j++) {
      brightest = bounces.light[shown.info.cols + j] > bounces.light[shown.info.cols + brightest] ? j : brightest;
    }
    double direct = contrast(&shown, bounces.light, brightest);
    double first = contrast(&shown, bounces.light + picture, brightest);
    clt_reproduced_add(out, "Fig. 13", "the highlight is only in the direct component, absent from the bounces",
                       direct > 1.3 && first < 0.5 * direct && first < 1.2,
                       "at the highlight the direct light is %.2f times its surroundings, the first bounce %.2f times",
                       direct, first);
    status = draw_highlight(&shown, &bounces, options->folder, error);
  }
  clt_bounces_finish(&bounces);
  clt_shown_close(&shown);
  return status;
}

static clt_status compute(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_status status = alternate(options, out, error);
  return status == CLT_OK ? keep_highlight_direct(options, out, error) : status;
}

const clt_figure clt_figure_bounces = {
    .name = "Figs. 12 and 13",
    .caption = "Pictures taken apart: the picture, its direct light, all that came back, and bounces 1 to 4, each at a "
               "brightness of its own. The report shows photographs; these are the scenes book.cfg and highlight.cfg.",
    .files = {{"fig12.png", "Fig. 12: green light on the left wall of a white dihedral.", true},
              {"fig13.png", "Fig. 13: a polished ball before two walls, all lit.", true},
              {"fig12-eq51.svg", "How far each bounce is off when solves stop at a residual of 0.1 %.", false}},
    .compute = compute};
