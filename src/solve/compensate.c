#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/method.h"
#include "solve/target.h"

/* The bounded solve that finds error_limit ends here. */
static const double LIMIT_TOLERANCE = 1e-6;

static void clip_to_image(const double *values, clt_image *image) {
  for (size_t i = 0; i < clt_image_size(image); i++) {
    image->data[i] = (float)fmin(fmax(values[i], 0), 1);
  }
}

/* The error that a drive will have: of its best single brightness, or as it is. */
static clt_status measure_error(const clt_transport *transport, const clt_certificate *certificate,
                                const clt_image *drive, const clt_image *target, bool best_gain, double *out,
                                clt_error *error) {
  clt_image seen = {0};
  clt_status status = clt_predict(transport, drive, &seen, error);
  if (status == CLT_OK) {
    *out = clt_appearance_error(certificate, &seen, target, best_gain);
  }
  clt_image_finish(&seen);
  return status;
}

/* The picture itself as the drive, clipped to 0..1. */
static clt_status measure_before(const clt_transport *transport, const clt_certificate *certificate,
                                 const clt_image *picture, const clt_image *target, double *out, clt_error *error) {
  clt_image drive = {0};
  clt_status status = clt_image_init(&drive, picture->channels, picture->height, picture->width, error);
  if (status == CLT_OK) {
    for (size_t i = 0; i < clt_image_size(picture); i++) {
      drive.data[i] = fminf(picture->data[i], 1);
    }
    status = measure_error(transport, certificate, &drive, target, true, out, error);
  }
  clt_image_finish(&drive);
  return status;
}

/* Goes on from the drive that was found (values, overwritten) to the bounded optimum. */
static clt_status measure_limit(const clt_transport *transport, const clt_certificate *certificate,
                                const double *wanted, const clt_image *target, double *values, double *out,
                                clt_error *error) {
  clt_solve_options options = {.method = "bounded", .tolerance = LIMIT_TOLERANCE, .start = values};
  clt_solve_result result;
  clt_image drive = {0};
  clt_status status = clt_solve(transport, certificate, wanted, &options, values, &result, error);
  if (status == CLT_OK) {
    status = clt_image_init(&drive, target->channels, target->height, target->width, error);
  }
  if (status == CLT_OK) {
    clip_to_image(values, &drive);
    status = measure_error(transport, certificate, &drive, target, false, out, error);
  }
  clt_image_finish(&drive);
  return status;
}

static double clipped_fraction(const clt_certificate *certificate, const clt_image *drive) {
  size_t cells = (size_t)drive->height * (size_t)drive->width, lit_cells = 0, clipped = 0;
  for (int c = 0; c < drive->channels; c++) {
    const unsigned char *lit = clt_certificate_lit(certificate, c);
    const float *x = clt_picture_channel(drive, c);
    for (size_t i = 0; i < cells; i++) {
      lit_cells += lit[i] != 0;
      clipped += lit[i] && (x[i] <= 0 || x[i] >= 1);
    }
  }
  return lit_cells > 0 ? (double)clipped / (double)lit_cells : 0;
}

/* wanted = target - b0 */
static void fill_wanted(const clt_transport *transport, const clt_image *target, double *wanted) {
  size_t cells = (size_t)target->height * (size_t)target->width;
  for (int c = 0; c < target->channels; c++) {
    const float *black = clt_transport_black(transport, c), *radiance = clt_picture_channel(target, c);
    for (size_t i = 0; i < cells; i++) {
      wanted[(size_t)c * cells + i] = (double)radiance[i] - (double)black[i];
    }
  }
}

/* Solves, and leaves the drive as a picture and its error. */
static clt_status solve_drive(const clt_transport *transport, const clt_certificate *certificate, const double *wanted,
                              const clt_solve_options *options, const clt_image *target, double *values,
                              clt_image *drive, clt_compensation *result, clt_error *error) {
  clt_status status = clt_solve(transport, certificate, wanted, options, values, &result->solve, error);
  if (status == CLT_OK) {
    status = clt_image_init(drive, target->channels, target->height, target->width, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  clip_to_image(values, drive);
  result->clipped_fraction = clipped_fraction(certificate, drive);
  return measure_error(transport, certificate, drive, target, false, &result->error_after, error);
}

static bool is_optimal(const clt_solve_result *result, const clt_solve_options *options) {
  return result->converged && strcmp(result->method, clt_method_bounded.name) == 0 && options != NULL &&
         options->tolerance > 0 && options->tolerance <= LIMIT_TOLERANCE;
}

clt_status clt_compensate(const clt_transport *transport, const clt_certificate *certificate, const clt_image *picture,
                          const clt_white *white, const clt_solve_options *options, bool find_limit, clt_image *drive,
                          clt_compensation *result, clt_error *error) {
  clt_image target = {0};
  double *wanted = NULL;
  *drive = (clt_image){0};
  *result = (clt_compensation){.error_limit = -1};
  clt_status status = clt_target(transport, certificate, picture, white, &target, result->white, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t values = clt_image_size(&target);
  wanted = clt_alloc(values, 2 * sizeof(double));
  if (wanted == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to compensate %zu cells", values);
    goto finish;
  }
  fill_wanted(transport, &target, wanted);
  status = solve_drive(transport, certificate, wanted, options, &target, wanted + values, drive, result, error);
  if (status == CLT_OK) {
    status = measure_before(transport, certificate, picture, &target, &result->error_before, error);
  }
  if (status == CLT_OK && find_limit) {
    result->error_limit = result->error_after;
  }
  if (status == CLT_OK && find_limit && !is_optimal(&result->solve, options)) {
    double limit = result->error_after;
    status = measure_limit(transport, certificate, wanted, &target, wanted + values, &limit, error);
    result->error_limit = fmin(limit, result->error_after);
  }

finish:
  if (status != CLT_OK) {
    clt_image_finish(drive);
  }
  clt_image_finish(&target);
  free(wanted);
  return status;
}
