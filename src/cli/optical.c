/* counterlight compensate without a transport: through the rig. */
#include "cli/optical.h"

#include "cli/answer.h"
#include "cli/measure.h"
#include "cli/picture.h"
#include "cli/progress.h"
#include "counterlight/acquire.h"
#include "counterlight/station.h"

typedef struct task {
  const char *target, *output;
  clt_station_config config;
  clt_station station;
  clt_optical_options options;
  cli_grid grid;
  clt_panel panel;
  clt_image picture, drive;
  clt_optical_result result;
  cli_progress progress;
} task;

static clt_status refuse_options(const cli_command *command, const cli_arguments *arguments, clt_error *error) {
  static const char *const names[] = {"method", "deadline-ms", "predict"};
  for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
    if (cli_value(command, arguments, names[k]) != NULL) {
      return clt_fail(error, CLT_BAD_INPUT, "--%s goes with a transport file, not with --config or --scene", names[k]);
    }
  }
  return CLT_OK;
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  const char *config = cli_value(command, arguments, "config"), *scene = cli_value(command, arguments, "scene");
  const char *white = cli_value(command, arguments, "white");
  clt_status status = cli_required(command, arguments, "target", &t->target, error);
  if (!status) {
    status = cli_required(command, arguments, "output", &t->output, error);
  }
  if (!status) {
    status = cli_picture_output_check(t->output, error);
  }
  if (!status && (arguments->positional_count > 0 || (config != NULL) == (scene != NULL))) {
    status = clt_fail(error, CLT_BAD_INPUT, "give one of a transport file, --config and --scene");
  }
  if (!status) {
    status = refuse_options(command, arguments, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "tolerance", 1e-12, 1, &t->options.tolerance, error);
  }
  if (!status) {
    status = cli_integer(command, arguments, "photographs", 4, 1000, &t->options.photographs, error);
  }
  if (!status && white) {
    status = clt_white_parse(white, &t->options.white, error);
  }
  if (!status) {
    status = config ? clt_station_read(config, &t->config, error) : clt_station_for_scene(scene, &t->config, error);
  }
  return status ? status : cli_station_options(command, arguments, &t->config, error);
}

static clt_status open_rig(task *t, clt_error *error) {
  clt_status status = cli_station_open(&t->config, &t->progress, &t->station, error);
  if (status) {
    return status;
  }
  clt_rig_info info;
  t->station.rig->operations->describe(t->station.rig, &info);
  t->grid = (cli_grid){info.width, info.height, info.channels};
  t->panel = clt_station_rig_config(&t->config, &t->station).projector;
  return CLT_OK;
}

static clt_status solve(task *t, clt_error *error) {
  clt_status status = cli_picture_read(t->target, NULL, &t->grid, &t->picture, error);
  if (!status) {
    t->options.progress = cli_progress_acquire;
    t->options.context = &t->progress;
    status = clt_optical_compensate(t->station.rig, &t->picture, &t->options, &t->drive, &t->result, error);
  }
  return status ? status : clt_panel_write(t->output, &t->panel, &t->drive, error);
}

static int answer(const cli_arguments *arguments, const task *t) {
  const clt_optical_result *r = &t->result;
  if (arguments->json) {
    return cli_print_json(json_pack("{s:s, s:o, s:o, s:o, s:n, s:o, s:o, s:s, s:s, s:i, s:i, s:i, s:o, s:b, s:o}",
                                    "output", t->output, "grid", cli_json_grid(&t->grid), "error_before",
                                    cli_json_number(r->error_before), "error_after", cli_json_number(r->error_after),
                                    "error_limit", "noise", cli_json_number(r->noise), "clipped_fraction",
                                    cli_json_number(r->clipped_fraction), "method", "optical", "reason", r->reason,
                                    "iterations", (int)r->curve_count, "photographs", r->photographs, "frames",
                                    r->frames, "solve_ms", cli_json_number(1e3 * r->seconds), "converged", r->converged,
                                    "white", cli_json_numbers(r->white, t->grid.channels)));
  }
  if (!arguments->quiet) {
    printf("%s: %.2f %% off (%.2f %% without compensation; noise of a photograph %.2f %%)\n", t->output,
           100 * r->error_after, 100 * r->error_before, 100 * r->noise);
    printf("optical, %d photographs, %d frames, %.1f s: %s\n", r->photographs, r->frames, r->seconds, r->reason);
  }
  return CLI_DONE;
}

int cli_compensate_optically(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  cli_progress_begin(&t.progress, arguments->quiet);
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = open_rig(&t, &error);
  }
  if (!status) {
    status = solve(&t, &error);
  }
  cli_progress_end(&t.progress);
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  clt_image_finish(&t.picture);
  clt_image_finish(&t.drive);
  clt_station_close(&t.station);
  return code;
}
