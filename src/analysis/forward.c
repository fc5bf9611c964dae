/* l_out from l_d by bounces: the series and the iteration. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "analysis/bounce_operator.h"
#include "base/memory.h"

enum { BOUNCES_MAX = 1000000, VECTORS = 3 };
static const double GROWTH = 1.5; /* of a bounce over the direct light: more than noise in A does */

static double norm_of(const double *values, size_t count) {
  double squares = 0;
  for (size_t i = 0; i < count; i++) {
    squares += values[i] * values[i];
  }
  return sqrt(squares);
}

clt_status clt_forward_check(const clt_bounce_operator *bounce, const double *direct, clt_error *error) {
  for (size_t i = 0; i < bounce->count; i++) {
    if (!isfinite(direct[i])) {
      return clt_fail(error, CLT_BAD_INPUT, "value %zu of the direct light is %g; every value must be a finite number",
                      i, direct[i]);
    }
  }
  return CLT_OK;
}

/* max |t_i| / u_i */
static double weighted(const double *term, const double *u, size_t count) {
  double most = 0;
  for (size_t i = 0; i < count; i++) {
    most = fmax(most, fabs(term[i]) / u[i]);
  }
  return most;
}

/* The norm is one of A only where A >= 0: a bounce that grows in it shows another. */
static clt_status check_fading(double now, double first, int bounce, clt_error *error) {
  return now <= GROWTH * first
             ? CLT_OK
             : clt_fail(
                   error, CLT_BAD_INPUT,
                   "bounce %d is %.3g times the direct light, so ||A|| is not below 1 and light would not settle: A "
                   "is not that of bounces; check F and T where A = I - F T^-1",
                   bounce, now / first);
}

/* Room for two vectors and u, and the norm that says whether bounces fade. */
static clt_status begin(const clt_bounce_operator *bounce, const double *direct, double **vectors,
                        clt_forward_result *result, clt_error *error) {
  *result = (clt_forward_result){0};
  *vectors = NULL;
  clt_status status = clt_forward_check(bounce, direct, error);
  if (status != CLT_OK) {
    return status;
  }
  *vectors = clt_alloc(VECTORS * bounce->count, sizeof **vectors);
  if (*vectors == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for the bounces of %zu values", bounce->count);
  }
  status = clt_bounce_norm(bounce, *vectors + 2 * bounce->count, *vectors, &result->norm, error);
  if (status == CLT_OK && !(result->norm < 1)) {
    status = clt_fail(error, CLT_BAD_INPUT,
                      "||A|| <= %.4g cannot be shown to be below 1, so light would not settle from bounce to bounce; a "
                      "room loses light at every bounce: check albedos, or F and T where A = I - F T^-1",
                      result->norm);
  }
  return status;
}

static void end(const double *direct, size_t count, double last, clt_forward_result *result) {
  double whole = norm_of(direct, count);
  result->last = whole > 0 ? last / whole : 0;
  result->bound = pow(result->norm, result->bounces + 1) / (1 - result->norm);
}

/* t_0 = l_d, t_(k+1) = A t_k, light = t_0 + ... + t_n; the last term ends in work. */
static clt_status add_terms(const clt_bounce_operator *bounce, const double *direct, int bounces, double *work,
                            double *light, clt_error *error) {
  size_t count = bounce->count;
  double *term = work, *next = work + count, *u = work + 2 * count, first = weighted(direct, u, count);
  clt_status status = CLT_OK;
  memcpy(term, direct, count * sizeof *term);
  memcpy(light, direct, count * sizeof *light);
  for (int k = 1; k <= bounces && status == CLT_OK; k++) {
    status = bounce->apply(bounce->context, term, next, error);
    for (size_t i = 0; i < count && status == CLT_OK; i++) {
      light[i] += term[i] = next[i];
    }
    status = status == CLT_OK ? check_fading(weighted(term, u, count), first, k, error) : status;
  }
  return status;
}

clt_status clt_forward_series(const clt_bounce_operator *bounce, const double *direct, int bounces, double *light,
                              clt_forward_result *result, clt_error *error) {
  clt_forward_result found;
  double *work = NULL;
  if (bounces < 0 || bounces > BOUNCES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d bounces were asked for; 0 to %d can be added", bounces, BOUNCES_MAX);
  }
  clt_status status = begin(bounce, direct, &work, &found, error);
  if (status == CLT_OK) {
    status = add_terms(bounce, direct, bounces, work, light, error);
  }
  if (status == CLT_OK && result != NULL) {
    found.bounces = bounces;
    end(direct, bounce->count, norm_of(work, bounce->count), &found);
    *result = found;
  }
  free(work);
  return status;
}

/* l <- l_d + A l; next takes what changed, which is A^k l_d. */
static clt_status advance(const clt_bounce_operator *bounce, const double *direct, double *light, double *next,
                          clt_error *error) {
  clt_status status = bounce->apply(bounce->context, light, next, error);
  for (size_t i = 0; i < bounce->count && status == CLT_OK; i++) {
    double value = direct[i] + next[i];
    next[i] = value - light[i];
    light[i] = value;
  }
  return status;
}

/* Steps until one changes less than `wanted`. */
static clt_status iterate(const clt_bounce_operator *bounce, const double *direct, double wanted, double *work,
                          double *light, clt_forward_result *found, clt_error *error) {
  size_t count = bounce->count;
  double *u = work + 2 * count, step = INFINITY, first = weighted(direct, u, count);
  clt_status status = CLT_OK;
  memcpy(light, direct, count * sizeof *light);
  while (status == CLT_OK && step > wanted && found->bounces < BOUNCES_MAX) {
    status = advance(bounce, direct, light, work, error);
    step = norm_of(work, count);
    found->bounces++;
    status = status == CLT_OK ? check_fading(weighted(work, u, count), first, found->bounces, error) : status;
  }
  if (status == CLT_OK && step > wanted) {
    status = clt_fail(error, CLT_FAILED, "after %d bounces light still changes by %.2g; ask for a larger tolerance",
                      found->bounces, step);
  }
  end(direct, count, step, found);
  return status;
}

clt_status clt_forward_iterate(const clt_bounce_operator *bounce, const double *direct, double tolerance, double *light,
                               clt_forward_result *result, clt_error *error) {
  clt_forward_result found;
  double *work = NULL;
  if (!(tolerance > 0) || !(tolerance < 1)) {
    return clt_fail(error, CLT_BAD_INPUT, "the tolerance %g is not above 0 and below 1; use one like 1e-6", tolerance);
  }
  clt_status status = begin(bounce, direct, &work, &found, error);
  if (status == CLT_OK) {
    status = iterate(bounce, direct, tolerance * norm_of(direct, bounce->count), work, light, &found, error);
  }
  free(work);
  if (status == CLT_OK && result != NULL) {
    *result = found;
  }
  return status;
}
