#include "tradeoff/judge.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

static const double BEST_TOLERANCE = 1e-6; /* of the solve for x* */

/* Norm over lit cells, relative to the target's. */
static double relative_norm(const clt_judge *judge, const double *values) {
  size_t cells = judge->info.cols;
  double sum = 0;
  for (int c = 0; c < judge->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(judge->certificate, c);
    for (size_t i = 0; i < cells; i++) {
      double value = values[(size_t)c * cells + i];
      sum += lit[i] ? value * value : 0;
    }
  }
  return sqrt(sum) / judge->size;
}

/* The size of the target or, where that is black, of white. */
static double target_size(const clt_judge *judge, const clt_image *target) {
  size_t cells = judge->info.cols;
  double sum = 0, white_sum = 0;
  for (int c = 0; c < judge->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(judge->certificate, c);
    double white = clt_certificate_channel(judge->certificate, c)->white;
    for (size_t i = 0; i < cells; i++) {
      double value = target->data[(size_t)c * cells + i];
      sum += lit[i] ? value * value : 0;
      white_sum += lit[i] ? white * white : 0;
    }
  }
  return sqrt(sum > 0 ? sum : white_sum);
}

static clt_status find_best(clt_judge *judge, double deadline_s, clt_error *error) {
  clt_solve_options options = {.method = "bounded", .tolerance = BEST_TOLERANCE, .deadline_s = deadline_s};
  clt_solve_result result;
  clt_status status =
      clt_solve(judge->transport, judge->certificate, judge->wanted, &options, judge->shown, &result, error);
  if (status == CLT_OK) {
    clt_transport_apply_all(judge->transport, judge->shown, judge->best_seen);
    for (size_t i = 0; i < judge->values; i++) {
      judge->part[i] = judge->best_seen[i] - judge->wanted[i];
    }
    judge->limit = relative_norm(judge, judge->part);
  }
  return status;
}

/* b = target - b0 */
static void take_wanted(clt_judge *judge, const clt_image *target) {
  size_t cells = judge->info.cols;
  for (size_t i = 0; i < judge->values; i++) {
    const float *black = clt_transport_black(judge->transport, (int)(i / cells));
    judge->wanted[i] = (double)target->data[i] - (double)black[i % cells];
  }
}

clt_status clt_judge_init(clt_judge *judge, const clt_transport *transport, const clt_certificate *certificate,
                          const clt_image *picture, const clt_white *white, double deadline_s, clt_error *error) {
  enum { ARRAYS = 6 };
  double whites[CLT_CHANNELS_MAX];
  clt_image target = {0};
  *judge = (clt_judge){.transport = transport, .certificate = certificate, .info = clt_transport_describe(transport)};
  judge->values = (size_t)judge->info.channels * judge->info.cols;
  clt_status status = clt_target(transport, certificate, picture, white, &target, whites, error);
  if (status != CLT_OK) {
    return status;
  }
  judge->wanted = clt_alloc(ARRAYS * judge->values, sizeof(double));
  if (judge->wanted == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to judge pictures of %zu cells", judge->values);
    goto finish;
  }
  double **arrays[] = {&judge->best_seen, &judge->seen, &judge->stored, &judge->shown, &judge->part};
  for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) {
    *arrays[i] = judge->wanted + (i + 1) * judge->values;
  }
  judge->size = target_size(judge, &target);
  if (!(judge->size > 0)) {
    status = clt_fail(error, CLT_BAD_INPUT,
                      "no cell of this transport is lit, so no drive changes what is seen; "
                      "measure the transport again");
    goto finish;
  }
  take_wanted(judge, &target);
  status = find_best(judge, deadline_s, error);

finish:
  clt_image_finish(&target);
  return status;
}

void clt_judge_finish(clt_judge *judge) {
  free(judge->wanted);
  *judge = (clt_judge){0};
}

/* sigma_i ||x'||, over lit rows; < 0 where no deviations are known. One that is infinite (a cell never seen) is that of
 * no lit cell. */
static double noise(const clt_judge *judge) {
  size_t cells = judge->info.cols;
  double sum = 0;
  for (int c = 0; c < judge->info.channels; c++) {
    const float *sigma = clt_transport_sigma(judge->transport, c);
    const unsigned char *lit = clt_certificate_lit(judge->certificate, c);
    const double *shown = judge->shown + (size_t)c * cells;
    double variances = 0, squares = 0;
    if (sigma == NULL) {
      return -1;
    }
    for (size_t i = 0; i < cells; i++) {
      variances += lit[i] && isfinite(sigma[i]) ? (double)sigma[i] * (double)sigma[i] : 0;
      squares += shown[i] * shown[i];
    }
    sum += variances * squares;
  }
  return sqrt(sum) / judge->size;
}

/* ||a - b|| */
static double distance(const clt_judge *judge, const double *a, const double *b) {
  for (size_t i = 0; i < judge->values; i++) {
    judge->part[i] = a[i] - b[i];
  }
  return relative_norm(judge, judge->part);
}

void clt_judge_drive(clt_judge *judge, const clt_transport *stored, const double *drive, bool keeps,
                     clt_tradeoff_point *point) {
  clt_transport_apply_all(judge->transport, drive, judge->seen);
  clt_transport_apply_all(stored, drive, judge->stored);
  point->storage_error = distance(judge, judge->seen, judge->stored);
  point->solver_error = distance(judge, judge->stored, keeps ? judge->best_seen : judge->wanted);
  for (size_t i = 0; i < judge->values; i++) {
    judge->shown[i] = fmin(fmax(drive[i], 0), 1);
  }
  clt_transport_apply_all(judge->transport, judge->shown, judge->stored);
  point->clipping_error = keeps ? judge->limit : distance(judge, judge->stored, judge->seen);
  point->error = distance(judge, judge->stored, judge->wanted);
  point->noise_error = noise(judge);
}
