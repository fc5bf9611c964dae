#include "tradeoff/json.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "tradeoff/front.h"

/* A number that is not known while it is negative. */
static json_t *known(double value) {
  return isfinite(value) && value >= 0 ? json_real(value) : json_null();
}

static json_t *point_json(const clt_tradeoff_point *point) {
  return json_pack("{s:s, s:s, s:f, s:i, s:f, s:f, s:i, s:f, s:f, s:f, s:f, s:o, s:f}", "method", point->method,
                   "storage", point->storage, "tolerance", point->tolerance, "iterations", point->iterations, "time_ms",
                   1e3 * point->seconds, "prepare_ms", 1e3 * point->prepare_seconds, "repeats", point->repeats, "error",
                   point->error, "solver_error", point->solver_error, "storage_error", point->storage_error,
                   "clipping_error", point->clipping_error, "noise_error", known(point->noise_error), "expected_error",
                   clt_tradeoff_expected(point));
}

json_t *clt_tradeoff_json(const clt_tradeoff *tradeoff) {
  size_t *order = clt_alloc(tradeoff->count + 1, sizeof *order);
  json_t *front = json_array(), *gaps = json_array();
  size_t count = order != NULL ? clt_front_list(tradeoff, order) : 0;
  for (size_t k = 0; k < count; k++) {
    json_array_append_new(front, point_json(&tradeoff->points[order[k]]));
  }
  for (size_t k = 0; k < tradeoff->gap_count; k++) {
    const clt_tradeoff_gap *gap = &tradeoff->gaps[k];
    json_array_append_new(
        gaps, json_pack("{s:s, s:s, s:s}", "method", gap->method, "storage", gap->storage, "why", gap->why));
  }
  free(order);
  json_t *chosen = point_json(&tradeoff->points[tradeoff->chosen]);
  json_object_set_new(chosen, "why", json_string(tradeoff->chosen_why));
  return json_pack("{s:{s:i, s:i, s:i}, s:s, s:o, s:o, s:o, s:o, s:I, s:o}", "grid", "width", tradeoff->width, "height",
                   tradeoff->height, "channels", tradeoff->channels, "sentence", tradeoff->sentence, "chosen", chosen,
                   "front", front, "limit", known(tradeoff->limit), "noise", known(tradeoff->noise), "solves",
                   (json_int_t)tradeoff->count, "gaps", gaps);
}
