/* Whether T still fits the room, by one photograph. */
#include <math.h>

#include "counterlight/loop.h"

static const double DEVIATIONS = 5, OWN_ERROR = 2;

typedef struct fit_sums {
  double off, noise, size; /* squares */
  size_t cells;
} fit_sums;

static bool same_size(const clt_image *image, const clt_transport_info *info) {
  return image->channels == info->channels && image->height == info->height && image->width == info->width;
}

static double squares(const float *values, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; i++) {
    sum += (double)values[i] * (double)values[i];
  }
  return sum;
}

static void compare_channel(const clt_transport *transport, const clt_certificate *certificate, int c, size_t cells,
                            const clt_image *drive, const clt_image *predicted, const clt_image *seen,
                            const clt_image *deviation, fit_sums *sums) {
  const unsigned char *lit = clt_certificate_lit(certificate, c);
  const float *sigma = clt_transport_sigma(transport, c), *black = clt_transport_black(transport, c);
  double driven = squares(drive->data + (size_t)c * cells, cells);
  for (size_t i = 0; i < cells; i++) {
    size_t at = (size_t)c * cells + i;
    double off = (double)seen->data[at] - (double)predicted->data[at], spread = deviation->data[at];
    double entry = sigma != NULL && isfinite(sigma[i]) ? (double)sigma[i] : 0;
    if (lit[i] && isfinite(off) && isfinite(spread)) {
      double light = (double)predicted->data[at] - (double)black[i];
      sums->off += off * off;
      sums->noise += spread * spread + entry * entry * driven;
      sums->size += light * light;
      sums->cells++;
    }
  }
}

clt_status clt_loop_check(const clt_transport *transport, const clt_certificate *certificate, const clt_image *drive,
                          const clt_image *seen, const clt_image *deviation, clt_fit *fit, clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  if (!same_size(drive, &info) || !same_size(seen, &info) || !same_size(deviation, &info)) {
    return clt_fail(error, CLT_BAD_INPUT, "drive, photograph and deviation must be %d x %d with %d channels, as T is",
                    info.width, info.height, info.channels);
  }
  clt_image predicted = {0};
  clt_status status = clt_predict(transport, drive, &predicted, error);
  if (status != CLT_OK) {
    return status;
  }
  fit_sums sums = {0};
  for (int c = 0; c < info.channels; c++) {
    compare_channel(transport, certificate, c, info.cols, drive, &predicted, seen, deviation, &sums);
  }
  clt_image_finish(&predicted);
  if (sums.cells == 0 || sums.size == 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "no lit cell was seen under this drive, so that nothing tells whether T fits; "
                    "show a picture with light in it");
  }
  /* a sum of squares of M normal values has a relative deviation of sqrt(2 / M) */
  double widened = sums.noise * (1 + DEVIATIONS * sqrt(2 / (double)sums.cells));
  double own = OWN_ERROR * fmax(clt_transport_origin(transport)->error, 0);
  fit->off = sqrt(sums.off / sums.size);
  fit->noise = sqrt(sums.noise / sums.size);
  fit->limit = sqrt(widened / sums.size + own * own);
  fit->cells = sums.cells;
  fit->fits = fit->off <= fit->limit;
  return CLT_OK;
}
