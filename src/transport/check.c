#include "transport/check.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"

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

/* Light cannot be negative: what noise may leave, relative to the largest entry. */
static const double NEGATIVE_MOST = 1e-2;
static const char finite_rule[] = "every value must be a finite number: measure or write it again";

static clt_status refuse(const clt_values *values, size_t position, double value, const char *rule, clt_error *error) {
  char index[80];
  format_index(values, position, index);
  if (isnan(value)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%s] is NaN; %s", values->source, values->name, index, rule);
  }
  if (isinf(value)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%s] is infinite or beyond float32; %s", values->source, values->name,
                    index, rule);
  }
  return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%s] is %.4g; %s", values->source, values->name, index, value, rule);
}

static clt_status refuse_value(const clt_values *values, size_t position, const char *rule, clt_error *error) {
  return refuse(values, position, (double)values->data[position], rule, error);
}

static clt_status refuse_negative(const clt_values *values, size_t position, double value, double largest,
                                  clt_error *error) {
  char rule[160];
  snprintf(rule, sizeof rule,
           "light cannot be negative beyond noise, -1 %% of the largest entry (%.4g): subtract the right black and "
           "measure again",
           largest);
  return refuse(values, position, value, rule, error);
}

clt_status clt_check_finite(const clt_values *values, clt_error *error) {
  size_t count = value_count(values);
  for (size_t i = 0; i < count; i++) {
    if (!(fabsf(values->data[i]) <= FLT_MAX)) {
      return refuse_value(values, i, finite_rule, error);
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
  return (double)least >= -NEGATIVE_MOST * (double)largest
             ? CLT_OK
             : refuse_negative(values, darkest, (double)least, (double)largest, error);
}

/* The extremes of the rows seen so far. */
typedef struct extremes {
  double largest, least;
  size_t darkest; /* position of the least */
} extremes;

static clt_status check_row(const clt_values *values, const double *row, size_t before, extremes *seen,
                            clt_error *error) {
  for (size_t j = 0; j < values->shape[2]; j++) {
    if (!isfinite(row[j])) {
      return refuse(values, before + j, row[j], finite_rule, error);
    }
    seen->largest = fmax(row[j], seen->largest);
    if (row[j] < seen->least) {
      seen->least = row[j];
      seen->darkest = before + j;
    }
  }
  return CLT_OK;
}

clt_status clt_check_rows(const clt_transport *transport, const char *source, const char *name, clt_error *error) {
  const clt_transport_info info = clt_transport_describe(transport);
  const clt_values values = {
      .source = source, .name = name, .rank = 3, .shape = {(size_t)info.channels, info.rows, info.cols}};
  extremes seen = {0};
  double *row = clt_alloc(info.cols, sizeof *row);
  clt_status status =
      row != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "%s: no memory for a row of %zu cells", source, info.cols);
  for (size_t k = 0; k < (size_t)info.channels * info.rows && status == CLT_OK; k++) {
    status = clt_transport_row(transport, (int)(k / info.rows), k % info.rows, row, error);
    status = status == CLT_OK ? check_row(&values, row, k * info.cols, &seen, error) : status;
  }
  free(row);
  return status != CLT_OK || seen.least >= -NEGATIVE_MOST * seen.largest
             ? status
             : refuse_negative(&values, seen.darkest, seen.least, seen.largest, error);
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

clt_status clt_check_near(const char *source, const char *group, const int64_t *start, const int32_t *cell,
                          size_t cells, size_t entries, clt_error *error) {
  for (size_t i = 0; i <= cells; i++) {
    const int64_t least = i == 0 ? 0 : start[i - 1];
    if (start[i] < least || start[i] > (int64_t)entries || (i == 0 && start[i] != 0) ||
        (i == cells && start[i] != (int64_t)entries)) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "%s: %s/start[%zu] is %lld; the starts ascend from 0 to the number of entries, %zu", source,
                      group, i, (long long)start[i], entries);
    }
  }
  for (size_t e = 0; e < entries; e++) {
    if (cell[e] < 0 || (size_t)cell[e] >= cells) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: %s/cell[%zu] is %d; the cells are 0..%zu", source, group, e, cell[e],
                      cells - 1);
    }
  }
  return CLT_OK;
}
