/* What a solve may be asked for. */
#include <math.h>

#include "solve/job.h"

static const double DEFAULT_TOLERANCE = 1e-4;
enum { DEFAULT_ITERATION_LIMIT = 1000 };

clt_status clt_solver_check_options(clt_solve_options *options, clt_error *error) {
  if (!(options->tolerance >= 0) || !isfinite(options->tolerance)) {
    return clt_fail(error, CLT_BAD_INPUT, "the tolerance %g is not a positive number; use one like 1e-4",
                    options->tolerance);
  }
  if (options->iteration_limit < 0) {
    return clt_fail(error, CLT_BAD_INPUT, "the iteration limit %d is negative; use one like %d, or 0 for that",
                    options->iteration_limit, DEFAULT_ITERATION_LIMIT);
  }
  if (isnan(options->deadline_s)) {
    return clt_fail(error, CLT_BAD_INPUT, "the deadline is not a number; use seconds, or 0 for none");
  }
  if (!(options->noise >= 0) || !isfinite(options->noise)) {
    return clt_fail(error, CLT_BAD_INPUT, "the noise %g is not a standard deviation; use one like 1e-3, or 0",
                    options->noise);
  }
  options->tolerance = options->tolerance > 0 ? options->tolerance : DEFAULT_TOLERANCE;
  options->iteration_limit = options->iteration_limit > 0 ? options->iteration_limit : DEFAULT_ITERATION_LIMIT;
  return CLT_OK;
}

clt_status clt_solver_check_finite(const double *values, size_t count, const char *what, clt_error *error) {
  static const double GREATEST = 1e150; /* squares stay finite */
  for (size_t i = 0; i < count; i++) {
    if (!(fabs(values[i]) <= GREATEST)) {
      return clt_fail(error, CLT_BAD_INPUT, "value %zu of the %s is %g; every value must be a finite number", i, what,
                      values[i]);
    }
  }
  return CLT_OK;
}
