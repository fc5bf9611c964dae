#include "transport/check.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

static size_t value_count(const clt_values *values) {
  size_t count = 1;
  for (int axis = 0; axis < values->rank; axis++) {
    count *= values->shape[axis];
  }
  return count;
}

/* Writes the position of a value as h5py and numpy index it: "0, 3, 4". */
static void format_index(const clt_values *values, size_t position, char text[80]) {
  size_t index[3] = {0};
  for (int axis = values->rank - 1; axis >= 0; axis--) {
    index[axis] = position % values->shape[axis];
    position /= values->shape[axis];
  }
  int used = 0;
  for (int axis = 0; axis < values->rank; axis++) {
    used += snprintf(text + used, 80 - (size_t)used, "%s%zu", axis == 0 ? "" : ", ", index[axis]);
  }
}

static clt_status refuse_value(const clt_values *values, size_t position, const char *rule, clt_error *error) {
  char index[80];
  format_index(values, position, index);
  double value = values->data[position];
  if (isnan(value)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%s] is NaN; %s", values->source, values->name, index, rule);
  }
  if (isinf(value)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%s] is infinite or beyond float32; %s", values->source, values->name,
                    index, rule);
  }
  return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%s] is %.4g; %s", values->source, values->name, index, value, rule);
}

clt_status clt_check_finite(const clt_values *values, clt_error *error) {
  size_t count = value_count(values);
  for (size_t i = 0; i < count; i++) {
    if (!(fabsf(values->data[i]) <= FLT_MAX)) {
      return refuse_value(values, i, "every value must be a finite number: measure or write it again", error);
    }
  }
  return CLT_OK;
}

clt_status clt_check_entries(const clt_values *values, clt_error *error) {
  clt_status status = clt_check_finite(values, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t count = value_count(values), darkest = 0;
  float largest = 0, least = 0;
  for (size_t i = 0; i < count; i++) {
    largest = values->data[i] > largest ? values->data[i] : largest;
    if (values->data[i] < least) {
      least = values->data[i];
      darkest = i;
    }
  }
  if ((double)least >= -1e-2 * (double)largest) {
    return CLT_OK;
  }
  char rule[160];
  snprintf(rule, sizeof rule,
           "light cannot be negative beyond noise, -1 %% of the largest entry (%.4g): subtract the right black and "
           "measure again",
           (double)largest);
  return refuse_value(values, darkest, rule, error);
}

clt_status clt_check_deviations(const clt_values *values, clt_error *error) {
  size_t count = value_count(values);
  for (size_t i = 0; i < count; i++) {
    if (!(values->data[i] >= 0)) {
      return refuse_value(values, i, "a standard deviation is not negative (infinite: never seen)", error);
    }
  }
  return CLT_OK;
}
