/* A picture taken apart into direct light, bounces and rest.
 *
 * b_0 = F x, b_(k+1) = A b_k, rest = R b_K. As S b_k = b_k + R b_k, what the terms miss of T x is the sum of the
 * solves' residuals, smoothed by R: the sum is a check of the solves, not forced. At dark cells b_0 = 0, and R b_K
 * means T F^-1 b_K there. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "analysis/interreflection.h"
#include "base/memory.h"

/* ||a - b|| / ||b|| over the lit cells of every channel; infinite where b is 0. */
static double lit_distance(const clt_interreflection *op, const double *a, const double *b) {
  double rest = 0, whole = 0;
  for (int c = 0; c < op->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(op->certificate, c);
    for (size_t i = 0; i < op->info.cells; i++) {
      size_t at = (size_t)c * op->info.cells + i;
      rest += lit[i] ? (a[at] - b[at]) * (a[at] - b[at]) : 0;
      whole += lit[i] ? b[at] * b[at] : 0;
    }
  }
  return whole > 0 ? sqrt(rest / whole) : INFINITY;
}

/* out = T F^-1 light, of the lit cells' light. */
static void scatter(clt_interreflection *op, const double *light, double *out) {
  size_t values = clt_interreflection_values(op);
  for (size_t i = 0; i < values; i++) {
    op->drive[i] = op->first_bounce[i] > 0 ? light[i] / op->first_bounce[i] : 0;
  }
  clt_transport_apply_all(op->transport, op->drive, out);
}

static clt_status begin(const clt_interreflection *op, int count, clt_bounces *out, clt_error *error) {
  *out = (clt_bounces){0};
  if (count < 0 || count > CLT_BOUNCES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d bounces were asked for; 0 to %d can be taken apart", count,
                    CLT_BOUNCES_MAX);
  }
  size_t values = clt_interreflection_values(op);
  *out = (clt_bounces){.count = count, .channels = op->info.channels, .cells = op->info.cells};
  out->light = clt_alloc(((size_t)count + 1) * values, sizeof(double));
  out->rest = clt_alloc(values, sizeof(double));
  out->picture = clt_alloc(values, sizeof(double));
  out->figures = clt_alloc((size_t)count + 1, sizeof *out->figures);
  if (!out->light || !out->rest || !out->picture || !out->figures) {
    clt_bounces_finish(out);
    return clt_fail(error, CLT_FAILED, "not enough memory for %d bounces of %zu cells", count, out->cells);
  }
  return CLT_OK;
}

/* Every bounce after light[0], and the rest. */
static clt_status follow(clt_interreflection *op, clt_bounces *out, clt_error *error) {
  size_t values = clt_interreflection_values(op);
  clt_status status = CLT_OK;
  double *light = out->light;
  for (int k = 1; k <= out->count && status == CLT_OK; k++, light += values) {
    status = clt_interreflection_apply(op, light, light + values, &out->figures[k].residual, error);
  }
  if (status == CLT_OK) {
    scatter(op, light, out->rest);
    for (size_t i = 0; i < values; i++) {
      out->rest[i] -= op->first_bounce[i] > 0 ? light[i] : 0;
    }
  }
  return status;
}

/* Shares, signs and the sum's error; op->seen takes the sum. */
static void measure(clt_interreflection *op, clt_bounces *out) {
  size_t values = clt_interreflection_values(op);
  double whole = 0, rest = 0;
  for (size_t i = 0; i < values; i++) {
    whole += out->picture[i];
    rest += out->rest[i];
    op->seen[i] = out->rest[i];
  }
  double scale = whole != 0 ? 1 / whole : 0;
  out->rest_share = rest * scale;
  for (int k = 0; k <= out->count; k++) {
    const double *light = out->light + (size_t)k * values;
    double sum = 0, below = 0, magnitude = 0;
    for (size_t i = 0; i < values; i++) {
      sum += light[i];
      below += light[i] < 0 ? -light[i] : 0;
      magnitude += fabs(light[i]);
      op->seen[i] += light[i];
    }
    out->figures[k].share = sum * scale;
    out->figures[k].negative = magnitude > 0 ? below / magnitude : 0;
  }
  double distance = lit_distance(op, op->seen, out->picture);
  out->sum_error = isfinite(distance) ? distance : 0;
}

static clt_status complete(clt_interreflection *op, clt_status status, clt_bounces *out, clt_error *error) {
  if (status == CLT_OK) {
    status = follow(op, out, error);
  }
  if (status != CLT_OK) {
    clt_bounces_finish(out);
    return status;
  }
  measure(op, out);
  return CLT_OK;
}

clt_status clt_bounces_of_drive(clt_interreflection *op, const double *drive, int count, clt_bounces *out,
                                clt_error *error) {
  clt_status status = begin(op, count, out, error);
  if (status != CLT_OK) {
    return status;
  }
  status = clt_interreflection_check(op, drive, "drive", error);
  if (status == CLT_OK) {
    size_t values = clt_interreflection_values(op);
    for (size_t i = 0; i < values; i++) {
      out->light[i] = op->first_bounce[i] * drive[i];
    }
    scatter(op, out->light, out->picture);
  }
  return complete(op, status, out, error);
}

clt_status clt_bounces_of_picture(clt_interreflection *op, const double *picture, int count, clt_bounces *out,
                                  clt_error *error) {
  clt_status status = begin(op, count, out, error);
  if (status != CLT_OK) {
    return status;
  }
  status = clt_interreflection_check(op, picture, "picture", error);
  if (status == CLT_OK) {
    memcpy(out->picture, picture, clt_interreflection_values(op) * sizeof *picture);
    status = clt_interreflection_solve(op, picture, &out->figures[0].residual, error);
  }
  for (size_t i = 0; status == CLT_OK && i < clt_interreflection_values(op); i++) {
    out->light[i] = op->first_bounce[i] * op->drive[i];
  }
  return complete(op, status, out, error);
}

void clt_bounces_finish(clt_bounces *bounces) {
  if (bounces != NULL) {
    free(bounces->light);
    free(bounces->rest);
    free(bounces->picture);
    free(bounces->figures);
    *bounces = (clt_bounces){0};
  }
}

/* step = l_d - S^-1 (b_0 + ... + b_(k-1)), which is b_k but for the solve's error, and that is relative to the sum. */
clt_status clt_bounces_compare_sums(clt_interreflection *op, const clt_bounces *bounces, double *difference,
                                    clt_error *error) {
  size_t values = clt_interreflection_values(op);
  double *sum = clt_alloc(values, 2 * sizeof *sum), *step = sum + values;
  if (sum == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for sums of %zu cells", op->info.cells);
  }
  difference[0] = 0;
  clt_status status = CLT_OK;
  for (int k = 1; k <= bounces->count && status == CLT_OK; k++) {
    const double *last = bounces->light + (size_t)(k - 1) * values;
    for (size_t i = 0; i < values; i++) {
      sum[i] += last[i];
    }
    status = clt_interreflection_solve(op, sum, NULL, error);
    for (size_t i = 0; i < values && status == CLT_OK; i++) {
      step[i] = bounces->light[i] - op->first_bounce[i] * op->drive[i];
    }
    difference[k] = status == CLT_OK ? lit_distance(op, step, last + values) : 0;
  }
  free(sum);
  return status;
}

static clt_status check_number(int n, clt_error *error) {
  return n >= 1 && n <= CLT_BOUNCES_MAX
             ? CLT_OK
             : clt_fail(error, CLT_BAD_INPUT, "bounce %d was asked for; 1 to %d are counted", n, CLT_BOUNCES_MAX);
}

clt_status clt_bounces_cancel(clt_interreflection *op, const double *picture, int n, double *out, clt_error *error) {
  clt_status status = check_number(n, error);
  for (int k = 0; k < n && status == CLT_OK; k++) {
    status = clt_interreflection_apply(op, k == 0 ? picture : out, out, NULL, error);
  }
  return status;
}

/* C^n = C^1 A^(n-1) = A^(n-1) C^1: in this order the dark cells come out too. */
clt_status clt_bounces_keep(clt_interreflection *op, const double *picture, int n, double *out, clt_error *error) {
  clt_status status = check_number(n, error);
  if (status == CLT_OK) {
    status = clt_interreflection_check(op, picture, "picture", error);
  }
  if (status == CLT_OK) {
    status = clt_interreflection_solve(op, picture, NULL, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  for (size_t i = 0; i < clt_interreflection_values(op); i++) {
    out[i] = op->first_bounce[i] * op->drive[i];
  }
  return n > 1 ? clt_bounces_cancel(op, out, n - 1, out, error) : CLT_OK;
}
