/* l_out from l_d by bounces: the series and the iteration. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "analysis/bounce_operator.h"
#include "base/memory.h"

enum { BOUNCES_MAX = 1000000, VECTORS = 2 };

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

/* Room for two vectors, and the norm that says whether bounces fade. */
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
  status = clt_bounce_norm(bounce, *vectors, *vectors + bounce->count, &result->norm, error);
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

/* t_0 = l_d, t_(k+1) = A t_k, l = t_0 + ... + t_n */
clt_status clt_forward_series(const clt_bounce_operator *bounce, const double *direct, int bounces, double *light,
                              clt_forward_result *result, clt_error *error) {
  clt_forward_result found;
  double *term = NULL;
  size_t count = bounce->count;
  if (bounces < 0 || bounces > BOUNCES_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%d bounces were asked for; 0 to %d can be added", bounces, BOUNCES_MAX);
  }
  clt_status status = begin(bounce, direct, &term, &found, error);
  if (status == CLT_OK) {
    double *next = term + count, *room = term;
    memcpy(term, direct, count * sizeof *term);
    memcpy(light, direct, count * sizeof *light);
    for (; found.bounces < bounces && status == CLT_OK; found.bounces++) {
      status = bounce->apply(bounce->context, term, next, error);
      for (size_t i = 0; i < count && status == CLT_OK; i++) {
        light[i] += next[i];
      }
      double *swap = term;
      term = next;
      next = swap;
    }
    end(direct, count, norm_of(term, count), &found);
    term = room;
  }
  free(term);
  if (status == CLT_OK && result != NULL) {
    *result = found;
  }
  return status;
}

/* l <- l_d + A l; returns in *step the norm of what changed. */
static clt_status advance(const clt_bounce_operator *bounce, const double *direct, double *light, double *next,
                          double *step, clt_error *error) {
  clt_status status = bounce->apply(bounce->context, light, next, error);
  double squares = 0;
  for (size_t i = 0; i < bounce->count && status == CLT_OK; i++) {
    double value = direct[i] + next[i];
    squares += (value - light[i]) * (value - light[i]);
    light[i] = value;
  }
  *step = sqrt(squares);
  return status;
}

clt_status clt_forward_iterate(const clt_bounce_operator *bounce, const double *direct, double tolerance, double *light,
                               clt_forward_result *result, clt_error *error) {
  clt_forward_result found;
  double *vectors = NULL;
  size_t count = bounce->count;
  if (!(tolerance > 0) || !(tolerance < 1)) {
    return clt_fail(error, CLT_BAD_INPUT, "the tolerance %g is not above 0 and below 1; use one like 1e-6", tolerance);
  }
  clt_status status = begin(bounce, direct, &vectors, &found, error);
  if (status == CLT_OK) {
    double wanted = tolerance * norm_of(direct, count), step = INFINITY;
    memcpy(light, direct, count * sizeof *light);
    while (status == CLT_OK && step > wanted && found.bounces < BOUNCES_MAX) {
      status = advance(bounce, direct, light, vectors, &step, error);
      found.bounces++;
    }
    if (status == CLT_OK && step > wanted) {
      status = clt_fail(error, CLT_FAILED, "after %d bounces light still changes by %.2g; ask for a larger tolerance",
                        found.bounces, step);
    }
    end(direct, count, step, &found);
  }
  free(vectors);
  if (status == CLT_OK && result != NULL) {
    *result = found;
  }
  return status;
}
