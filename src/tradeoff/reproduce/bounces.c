/* Figs. 12 and 13: a picture taken apart bounce by bounce. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "counterlight/analysis.h"
#include "tradeoff/reproduce/shown.h"

enum { BOUNCES = 4 };

static clt_status take_apart(const clt_shown *shown, clt_bounces *bounces, clt_error *error) {
  clt_interreflection *interreflection = NULL;
  clt_status status = clt_interreflection_create(shown->transport, shown->certificate, NULL, &interreflection, error);
  if (status == CLT_OK) {
    status = clt_bounces_of_drive(interreflection, shown->drive, BOUNCES, bounces, error);
  }
  clt_interreflection_destroy(interreflection);
  return status;
}

/* The picture, its direct light and its bounces side by side. */
static clt_status draw(const clt_reproduce_options *options, const char *file, const clt_shown *shown,
                       const clt_bounces *bounces, clt_error *error) {
  size_t picture = shown->info.cols * (size_t)shown->info.channels;
  double *values = clt_alloc((BOUNCES + 2) * picture, sizeof *values);
  clt_image strip = {0};
  if (values == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: not enough memory", file);
  }
  memcpy(values, bounces->picture, picture * sizeof *values);
  memcpy(values + picture, bounces->light, (BOUNCES + 1) * picture * sizeof *values);
  clt_status status = clt_shown_strip(shown, values, BOUNCES + 2, &strip, error);
  if (status == CLT_OK) {
    status = clt_figure_picture(options->folder, file, &strip, error);
  }
  clt_image_finish(&strip);
  free(values);
  return status;
}

/* The share of bounce k that lies on the left half of the picture. */
static double left_share(const clt_shown *shown, const clt_bounces *bounces, int k) {
  size_t picture = shown->info.cols * (size_t)shown->info.channels, width = (size_t)shown->info.width;
  double left = 0.0, all = 0.0;
  for (size_t i = 0; i < picture; i++) {
    double value = bounces->light[(size_t)k * picture + i];
    left += i % width < width / 2 ? value : 0.0;
    all += value;
  }
  return left / all;
}

/* Green light on the left half of the white dihedral. */
static clt_status alternate(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_shown shown;
  clt_bounces bounces = {0};
  clt_status status = clt_shown_open(options, "dihedral", &shown, error);
  if (status == CLT_OK) {
    size_t width = (size_t)shown.info.width;
    for (size_t j = 0; j < shown.info.cols; j++) {
      shown.drive[shown.info.cols + j] = j % width < width / 2 - 1 ? 1.0 : 0.0;
    }
    status = take_apart(&shown, &bounces, error);
  }
  if (status == CLT_OK) {
    double wrong[BOUNCES + 1];
    for (int k = 0; k <= BOUNCES; k++) {
      double left = left_share(&shown, &bounces, k);
      wrong[k] = 100.0 * (k % 2 == 0 ? 1.0 - left : left);
    }
    clt_reproduced_add(
        out, "Fig. 12", "successive bounces alternate perfectly between the two walls",
        fmax(fmax(wrong[1], wrong[2]), wrong[3]) < 5.0,
        "%.1f, %.1f, %.1f, %.1f %% of bounces 1 to 4 on the wrong wall (light returns within a bounce from "
        "where the walls reach beyond the picture); they sum to the picture to %.0e",
        wrong[1], wrong[2], wrong[3], wrong[4], bounces.sum_error);
    status = draw(options, "fig12.png", &shown, &bounces, error);
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

/* The ball's highlight is where it outshines its surroundings most. */
static clt_status keep_highlight_direct(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_shown shown;
  clt_bounces bounces = {0};
  clt_status status = clt_shown_open(options, "highlight", &shown, error);
  if (status == CLT_OK) {
    for (size_t k = 0; k < shown.info.cols * (size_t)shown.info.channels; k++) {
      shown.drive[k] = 1.0;
    }
    status = take_apart(&shown, &bounces, error);
  }
  if (status == CLT_OK) {
    size_t picture = shown.info.cols * (size_t)shown.info.channels, brightest = 0;
    for (size_t j = 0; j < shown.info.cols; j++) {
      brightest = bounces.light[shown.info.cols + j] > bounces.light[shown.info.cols + brightest] ? j : brightest;
    }
    double direct = contrast(&shown, bounces.light, brightest);
    double first = contrast(&shown, bounces.light + picture, brightest);
    clt_reproduced_add(out, "Fig. 13", "the highlight is only in the direct component, absent from the bounces",
                       direct > 1.3 && first < 0.5 * direct && first < 1.2,
                       "at the highlight the direct light is %.2f times its surroundings, the first bounce %.2f times",
                       direct, first);
    status = draw(options, "fig13.png", &shown, &bounces, error);
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
    .caption = "The picture, its direct light and four bounces, each at a brightness of its own: green light on one "
               "half of a white dihedral, and a polished ball before two walls.",
    .files = {"fig12.png", "fig13.png"},
    .compute = compute};
