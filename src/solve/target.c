/* Pictures as radiances: the target, what a drive will look like, and how far the two are apart. */
#include "solve/target.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

clt_status clt_check_picture(const clt_transport *transport, const clt_image *picture, const char *what,
                             clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  if (picture->channels != info.channels || picture->height != info.height || picture->width != info.width) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the %s is %d x %d with %d channels, but the transport's grid is %d x %d with %d; resize it", what,
                    picture->width, picture->height, picture->channels, info.width, info.height, info.channels);
  }
  if (info.rows != info.cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the transport observes %zu cells but drives %zu, so a %s on its grid has no radiance; use a "
                    "transport whose camera shares the projector's grid",
                    info.rows, info.cols, what);
  }
  for (size_t i = 0; i < clt_image_size(picture); i++) {
    if (!(picture->data[i] >= 0) || !isfinite(picture->data[i])) {
      return clt_fail(error, CLT_BAD_INPUT, "sample %zu of the %s is %g; light must be finite and not below 0", i, what,
                      (double)picture->data[i]);
    }
  }
  return CLT_OK;
}

const float *clt_picture_channel(const clt_image *picture, int channel) {
  return picture->data + (size_t)channel * (size_t)picture->height * (size_t)picture->width;
}

static clt_status choose_white(const clt_transport *transport, const clt_certificate *certificate,
                               const clt_image *picture, const clt_white *white, double *value, clt_error *error) {
  if (white->kind == CLT_WHITE_VALUE && (!(white->value > 0) || !isfinite(white->value))) {
    return clt_fail(error, CLT_BAD_INPUT, "white is %g; it must be a radiance above 0", white->value);
  }
  for (int c = 0; c < picture->channels; c++) {
    value[c] = white->kind == CLT_WHITE_VALUE ? white->value : clt_certificate_channel(certificate, c)->white;
  }
  if (white->kind != CLT_WHITE_FEASIBLE) {
    return CLT_OK;
  }
  double factor = 0;
  clt_status status = clt_white_feasible(transport, certificate, picture, value, &factor, error);
  for (int c = 0; status == CLT_OK && c < picture->channels; c++) {
    value[c] *= factor;
  }
  return status;
}

clt_status clt_target(const clt_transport *transport, const clt_certificate *certificate, const clt_image *picture,
                      const clt_white *white, clt_image *target, double *white_value, clt_error *error) {
  static const clt_white MEDIAN = {.kind = CLT_WHITE_AUTO};
  clt_status status = clt_check_picture(transport, picture, "picture", error);
  if (status == CLT_OK) {
    status = choose_white(transport, certificate, picture, white != NULL ? white : &MEDIAN, white_value, error);
  }
  if (status == CLT_OK) {
    status = clt_image_init(target, picture->channels, picture->height, picture->width, error);
  }
  size_t cells = clt_image_size(picture) / (size_t)picture->channels;
  for (size_t i = 0; status == CLT_OK && i < clt_image_size(picture); i++) {
    target->data[i] = (float)(white_value[i / cells] * (double)picture->data[i]);
  }
  return status;
}

clt_status clt_predict(const clt_transport *transport, const clt_image *drive, clt_image *seen, clt_error *error) {
  clt_status status = clt_check_picture(transport, drive, "drive", error);
  if (status != CLT_OK) {
    return status;
  }
  size_t cells = (size_t)drive->height * (size_t)drive->width;
  double *x = clt_alloc(cells, 2 * sizeof(double)), *y = x + cells;
  if (x == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to predict %zu cells", cells);
  }
  status = clt_image_init(seen, drive->channels, drive->height, drive->width, error);
  for (int c = 0; status == CLT_OK && c < drive->channels; c++) {
    const float *from = clt_picture_channel(drive, c), *black = clt_transport_black(transport, c);
    for (size_t i = 0; i < cells; i++) {
      x[i] = from[i];
    }
    clt_transport_apply(transport, c, x, y);
    for (size_t i = 0; i < cells; i++) {
      seen->data[(size_t)c * cells + i] = (float)(y[i] + (double)black[i]);
    }
  }
  free(x);
  return status;
}

/* sum over lit cells of (gain y - t)^2 and of t^2; y't and y'y; and what t't is for a white target. */
typedef struct moments {
  double distance, target_target, seen_target, seen_seen, white_white;
} moments;

static moments lit_moments(const clt_certificate *certificate, const clt_image *seen, const clt_image *target,
                           double gain) {
  size_t cells = (size_t)target->height * (size_t)target->width;
  moments sum = {0};
  for (int c = 0; c < target->channels; c++) {
    const unsigned char *lit = clt_certificate_lit(certificate, c);
    const float *seen_values = clt_picture_channel(seen, c), *target_values = clt_picture_channel(target, c);
    double white = clt_certificate_channel(certificate, c)->white;
    for (size_t i = 0; i < cells; i++) {
      if (lit[i]) {
        double y = seen_values[i], t = target_values[i];
        sum.distance += (gain * y - t) * (gain * y - t);
        sum.target_target += t * t;
        sum.seen_target += y * t;
        sum.seen_seen += y * y;
        sum.white_white += white * white;
      }
    }
  }
  return sum;
}

double clt_best_gain(const clt_certificate *certificate, const clt_image *seen, const clt_image *target) {
  moments sum = lit_moments(certificate, seen, target, 1);
  return sum.seen_seen > 0 ? sum.seen_target / sum.seen_seen : 1;
}

double clt_appearance_error(const clt_certificate *certificate, const clt_image *seen, const clt_image *target,
                            bool best_gain) {
  double gain = best_gain ? clt_best_gain(certificate, seen, target) : 1;
  moments sum = lit_moments(certificate, seen, target, gain);
  double size = sum.target_target > 0 ? sum.target_target : sum.white_white;
  return size > 0 ? sqrt(sum.distance / size) : 0;
}
