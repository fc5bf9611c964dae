#include "cli/relight_forward.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "cli/answer.h"
#include "cli/light_files.h"

enum { DEFAULT_BOUNCES = 8, DEFAULT_SAMPLES = 64 };

/* A run: values are channels * cells doubles. */
typedef struct task {
  cli_forward *forward;
  const cli_input *input;
  clt_interreflection *room;
  size_t cells, values;
  double *direct, *light, *seen, *deviation; /* F x, l_out, T x; standard errors */
} task;

static clt_status of_bounces(task *t, clt_error *error) {
  clt_bounce_operator bounce = clt_bounce_operator_of_transport(t->room);
  cli_forward *forward = t->forward;
  return strcmp(forward->method, "series") == 0
             ? clt_forward_series(&bounce, t->direct, forward->bounces, t->light, &forward->result, error)
             : clt_forward_iterate(&bounce, t->direct, forward->tolerance, t->light, &forward->result, error);
}

/* One channel's paths; entries has room for its A. */
static clt_status draw_channel(task *t, int channel, double *entries, clt_error *error) {
  size_t first = (size_t)channel * t->cells;
  clt_bounce_entries dense = {t->cells, entries};
  clt_bounce_operator bounce = clt_bounce_operator_of_entries(&dense);
  clt_forward_paths *paths = NULL;
  clt_status status = clt_interreflection_entries(t->room, channel, entries, error);
  if (!status) {
    status = clt_forward_paths_create(&bounce, &paths, error);
  }
  if (!status) {
    uint64_t seed = (uint64_t)t->forward->seed * CLT_CHANNELS_MAX + (uint64_t)channel;
    status = clt_forward_paths_estimate(paths, t->direct + first, t->forward->samples, seed, t->light + first,
                                        t->deviation + first, error);
  }
  clt_forward_paths_destroy(paths);
  return status;
}

static clt_status of_paths(task *t, clt_error *error) {
  double *entries = clt_alloc(t->cells * t->cells, sizeof *entries);
  clt_status status =
      entries ? CLT_OK : clt_fail(error, CLT_FAILED, "not enough memory for the bounces of %zu cells", t->cells);
  for (int c = 0; !status && c < t->input->grid.channels; c++) {
    status = draw_channel(t, c, entries, error);
  }
  free(entries);
  return status;
}

static const struct {
  const char *name;
  clt_status (*run)(task *t, clt_error *error);
} methods[] = {{"series", of_bounces}, {"iteration", of_bounces}, {"montecarlo", of_paths}};
enum { METHODS = sizeof methods / sizeof methods[0] };

clt_status cli_forward_read(const cli_command *command, const cli_arguments *arguments, cli_forward *forward,
                            clt_error *error) {
  *forward = (cli_forward){.method = cli_value(command, arguments, "forward"),
                           .bounces = DEFAULT_BOUNCES,
                           .samples = DEFAULT_SAMPLES,
                           .tolerance = 1e-6};
  forward->how.exact_first_bounce = cli_value(command, arguments, "exact-first-bounce") != NULL;
  bool known = forward->method == NULL;
  for (int k = 0; k < METHODS; k++) {
    known = known || strcmp(forward->method, methods[k].name) == 0;
  }
  if (!known) {
    return clt_fail(error, CLT_BAD_INPUT, "--forward %s does not exist; take series, iteration or montecarlo",
                    forward->method);
  }
  clt_status status = cli_integer(command, arguments, "bounces", 0, 1000, &forward->bounces, error);
  if (!status) {
    status = cli_number(command, arguments, "tolerance", 1e-8, 0.5, &forward->tolerance, error);
  }
  if (!status) {
    status = cli_integer(command, arguments, "samples", 1, 1000000, &forward->samples, error);
  }
  return status ? status : cli_integer(command, arguments, "seed", 0, 1000000, &forward->seed, error);
}

/* F x and T x of the drive. */
static clt_status begin(task *t, const clt_image *drive, clt_error *error) {
  clt_status status =
      clt_interreflection_create(t->input->transport, t->input->certificate, &t->forward->how, &t->room, error);
  t->values = cli_grid_values(&t->input->grid);
  t->cells = t->values / (size_t)t->input->grid.channels;
  t->direct = clt_alloc(4 * t->values, sizeof *t->direct);
  if (!status && t->direct == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory for the light of %zu cells", t->cells);
  }
  if (status) {
    return status;
  }
  t->light = t->direct + t->values;
  t->seen = t->light + t->values;
  t->deviation = t->seen + t->values;
  for (size_t i = 0; i < t->values; i++) {
    double first_bounce = clt_interreflection_first_bounce(t->room, (int)(i / t->cells))[i % t->cells];
    t->light[i] = first_bounce > 0 ? drive->data[i] : 0;
    t->direct[i] = first_bounce * drive->data[i];
  }
  clt_transport_apply_all(t->input->transport, t->light, t->seen);
  return CLT_OK;
}

static void compare(task *t) {
  double off = 0, whole = 0, spread = 0;
  for (size_t i = 0; i < t->values; i++) {
    off += (t->light[i] - t->seen[i]) * (t->light[i] - t->seen[i]);
    whole += t->seen[i] * t->seen[i];
    spread += t->deviation[i] * t->deviation[i];
  }
  t->forward->difference = whole > 0 ? sqrt(off / whole) : 0;
  t->forward->deviation = whole > 0 ? sqrt(spread / whole) : 0;
}

clt_status cli_forward_relight(cli_forward *forward, const cli_input *input, const clt_image *drive, clt_image *seen,
                               clt_error *error) {
  task t = {.forward = forward, .input = input};
  clt_status status = begin(&t, drive, error);
  for (int k = 0; !status && k < METHODS; k++) {
    status = strcmp(methods[k].name, forward->method) == 0 ? methods[k].run(&t, error) : CLT_OK;
  }
  if (!status) {
    compare(&t);
    for (size_t i = 0; i < t.values; i++) {
      t.light[i] += (double)clt_transport_black(input->transport, (int)(i / t.cells))[i % t.cells];
    }
    status = cli_values_image(t.light, &input->grid, seen, error);
  }
  clt_interreflection_destroy(t.room);
  free(t.direct);
  return status;
}

static bool draws(const cli_forward *forward) {
  return strcmp(forward->method, "montecarlo") == 0;
}

json_t *cli_forward_json(const cli_forward *forward) {
  const clt_forward_result *result = &forward->result;
  json_t *object = json_pack("{s:s, s:s, s:f}", "method", forward->method, "first_bounce",
                             forward->how.exact_first_bounce ? "exact" : "diagonal", "difference", forward->difference);
  json_t *more = draws(forward) ? json_pack("{s:i, s:i, s:o}", "samples", forward->samples, "seed", forward->seed,
                                            "standard_error", cli_json_number(forward->deviation))
                                : json_pack("{s:i, s:f, s:f, s:f}", "bounces", result->bounces, "norm", result->norm,
                                            "last", result->last, "bound", result->bound);
  json_object_update(object, more);
  json_decref(more);
  return object;
}

void cli_forward_print(const cli_forward *forward) {
  if (draws(forward)) {
    printf("%d paths a cell: standard error %.2g of the light, %.2g off from T x\n", forward->samples,
           forward->deviation, forward->difference);
  } else {
    printf("%d bounces, ||A|| <= %.3g: the last is %.2g of the direct light, %.2g off from T x\n",
           forward->result.bounces, forward->result.norm, forward->result.last, forward->difference);
  }
}
