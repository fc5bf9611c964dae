/* Parts of the commands' JSON answers and of their printed ones. */
#include "cli/answer.h"

#include <math.h>

json_t *cli_json_number(double value) {
  return isfinite(value) ? json_real(value) : json_null();
}

json_t *cli_json_grid(const cli_grid *grid) {
  return json_pack("{s:i, s:i, s:i}", "width", grid->width, "height", grid->height, "channels", grid->channels);
}

json_t *cli_json_numbers(const double *values, int count) {
  json_t *array = json_array();
  for (int i = 0; i < count; i++) {
    json_array_append_new(array, cli_json_number(values[i]));
  }
  return array;
}

void cli_json_add_compensation(json_t *object, const clt_compensation *compensation, int channels) {
  const clt_solve_result *solve = &compensation->solve;
  json_object_set_new(object, "error_before", cli_json_number(compensation->error_before));
  json_object_set_new(object, "error_after", cli_json_number(compensation->error_after));
  json_object_set_new(object, "error_limit", cli_json_number(compensation->error_limit));
  json_object_set_new(object, "clipped_fraction", cli_json_number(compensation->clipped_fraction));
  json_object_set_new(object, "method", json_string(solve->method));
  json_object_set_new(object, "reason", json_string(solve->reason));
  json_object_set_new(object, "iterations", json_integer(solve->iterations));
  json_object_set_new(object, "products", json_integer(solve->products));
  json_object_set_new(object, "solve_ms", cli_json_number(1e3 * solve->seconds));
  json_object_set_new(object, "residual", cli_json_number(solve->residual));
  json_object_set_new(object, "converged", json_boolean(solve->converged));
  json_object_set_new(object, "white", cli_json_numbers(compensation->white, channels));
}

static void add_text(json_t *object, const char *key, const char *text) {
  if (*text) {
    json_object_set_new(object, key, json_string(text));
  }
}

json_t *cli_json_provenance(const clt_provenance *origin) {
  json_t *object = json_object();
  add_text(object, "scheme", origin->scheme);
  add_text(object, "plan", origin->plan);
  add_text(object, "source", origin->source);
  add_text(object, "response", origin->response);
  if (origin->acquired > 0) {
    json_object_set_new(object, "acquired", json_integer(origin->acquired));
  }
  if (origin->patterns > 0) {
    json_object_set_new(object, "patterns", json_integer(origin->patterns));
    json_object_set_new(object, "frames", json_integer(origin->frames));
    json_object_set_new(object, "seconds", cli_json_number(origin->seconds));
  }
  if (origin->error >= 0) {
    json_object_set_new(object, "error", cli_json_number(origin->error));
  }
  return object;
}
