/* What white means. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/method.h"
#include "solve/target.h"

clt_status clt_white_parse(const char *text, clt_white *white, clt_error *error) {
  *white = (clt_white){0};
  if (strcmp(text, "auto") == 0) {
    white->kind = CLT_WHITE_AUTO;
    return CLT_OK;
  }
  if (strcmp(text, "feasible") == 0) {
    white->kind = CLT_WHITE_FEASIBLE;
    return CLT_OK;
  }
  char *end;
  white->kind = CLT_WHITE_VALUE;
  white->value = strtod(text, &end);
  if (end == text || *end != '\0' || !(white->value > 0) || !isfinite(white->value)) {
    return clt_fail(error, CLT_BAD_INPUT, "white \"%.40s\" is none of auto, feasible and a radiance above 0", text);
  }
  return CLT_OK;
}

/* The factors s for which every drive s u_i - v_i stays in 0..1. */
typedef struct interval {
  double low, high;
} interval;

/* s * slope >= bound */
static void require(interval *factors, double slope, double bound) {
  if (slope > 0) {
    factors->low = fmax(factors->low, bound / slope);
  } else if (slope < 0) {
    factors->high = fmin(factors->high, bound / slope);
  } else if (bound > 0) {
    factors->high = -INFINITY;
  }
}

/* Below 0 the solver's own error (relative to the brightest drive) is forgiven: a black cell would otherwise decide. */
static void require_channel(interval *factors, const double *u, const double *v, const unsigned char *lit,
                            size_t count) {
  static const double SLACK = 1e-7;
  double brightest = 0, darkest = 0;
  for (size_t i = 0; i < count; i++) {
    brightest = fmax(brightest, lit[i] ? fabs(u[i]) : 0);
    darkest = fmax(darkest, lit[i] ? fabs(v[i]) : 0);
  }
  for (size_t i = 0; i < count; i++) {
    if (lit[i]) {
      require(factors, u[i] + SLACK * brightest, v[i] - SLACK * darkest); /* s u - v >= 0 */
      require(factors, -u[i], -1 - v[i]);                                 /* s u - v <= 1 */
    }
  }
}

/* u and v: the unbounded drives for white * picture and for b0. */
static clt_status solve_both(const clt_transport *transport, const clt_certificate *certificate,
                             const clt_image *picture, const double *white, double *wanted, double *u, double *v,
                             clt_error *error) {
  static const double PRECISE = 1e-9;
  clt_transport_info info = clt_transport_describe(transport);
  const clt_method *method = clt_method_linear(clt_certificate_worst(certificate).reciprocity);
  clt_solve_options options = {.method = method->name, .tolerance = PRECISE};
  clt_solve_result result;
  for (size_t i = 0; i < (size_t)info.channels * info.rows; i++) {
    wanted[i] = white[i / info.rows] * (double)picture->data[i];
  }
  clt_status status = clt_solve(transport, certificate, wanted, &options, u, &result, error);
  if (status != CLT_OK) {
    return status;
  }
  for (size_t i = 0; i < (size_t)info.channels * info.rows; i++) {
    wanted[i] = clt_transport_black(transport, (int)(i / info.rows))[i % info.rows];
  }
  return clt_solve(transport, certificate, wanted, &options, v, &result, error);
}

clt_status clt_white_feasible(const clt_transport *transport, const clt_certificate *certificate,
                              const clt_image *picture, const double *white, double *factor, clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  size_t values = (size_t)info.channels * info.cols;
  double *work = clt_alloc(3 * values, sizeof(double));
  if (work == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to find the feasible white");
  }
  double *u = work, *v = work + values, *wanted = work + 2 * values;
  clt_status status = solve_both(transport, certificate, picture, white, wanted, u, v, error);
  interval factors = {0, INFINITY};
  for (int c = 0; status == CLT_OK && c < info.channels; c++) {
    size_t at = (size_t)c * info.cols;
    require_channel(&factors, u + at, v + at, clt_certificate_lit(certificate, c), info.cols);
  }
  free(work);
  if (status == CLT_OK && (!(factors.high > 0) || !isfinite(factors.high) || factors.low > factors.high)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "no white makes every cell of this picture reachable (dark cells beside bright ones receive more "
                    "light from the room than they should show); use white auto");
  }
  *factor = factors.high;
  return status;
}
