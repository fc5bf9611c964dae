/* counterlight acquire: measures the light transport and stores it. */
#include <unistd.h>

#include "cli/answer.h"
#include "cli/command.h"
#include "cli/measure.h"
#include "cli/picture.h"

static const cli_option options[] = {
    {"config", 'c', "C", "configuration that names the devices"},
    {"scene", 's', "S", "scene file: measure with simulated devices"},
    {"output", 'o', "T.h5", "where the transport goes"},
    {"scheme", 0, "NAME", "auto, brute (a cell at a time), hadamard, hierarchical or blocks"},
    {"error", 0, "X", "wanted appearance error: blocks stops there, auto chooses by it (0..0.5)"},
    {"seconds", 0, "X", "time allowed: blocks stops there, auto chooses by it"},
    {"resume", 0, "FILE", "keep every observation there, and begin with those it holds"},
    {"calibration", 0, "FILE", "of the rig (default: the configuration's)"},
    {"record", 0, "DIR", "keep every frame there"},
    {"replay", 0, "DIR", "take the frames from a recording, no device is opened"},
    {"threshold", 0, "X", "hierarchical: fraction of a cell's light left unresolved (0..0.5)"},
    {"repeats", 0, "N", "observations averaged for black and flood (1..256)"},
    {"watch", 0, "N", "patterns between two looks at their sum and the room (0: none; default 25)"},
    {"patience", 0, "X", "seconds to wait for a room or device that is disturbed (default 30)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Ctrl-C ends it with nothing written but the file of --resume: the same command then goes on from there, also\n"
    "after a crash. The file is removed when the transport is stored.\n"
    "A camera with pixels of its own and no calibration is calibrated first. --replay needs the configuration or the\n"
    "scene of the recording, which give the rig's settings, and the same options: the same T comes out.\n"
    "The check error is the relative RMS between random patterns as observed and as\n"
    "the stored transport predicts them.\n";

typedef struct task {
  const char *output;
  clt_station_config config;
  clt_station station;
  clt_transport *transport;
  cli_progress progress;
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  const char *config = cli_value(command, arguments, "config"), *scene = cli_value(command, arguments, "scene");
  clt_status status = cli_required(command, arguments, "output", &t->output, error);
  if (!status) {
    status = cli_output_check(t->output, error);
  }
  if (!status && (config != NULL) == (scene != NULL)) {
    status = clt_fail(error, CLT_BAD_INPUT, "give either --config or --scene; usage: counterlight acquire %s",
                      command->synopsis);
  }
  if (!status) {
    status = config ? clt_station_read(config, &t->config, error) : clt_station_for_scene(scene, &t->config, error);
  }
  return status ? status : cli_measure_options(command, arguments, &t->config, error);
}

static clt_status measure(task *t, clt_error *error) {
  clt_status status = cli_station_open(&t->config, &t->progress, &t->station, error);
  if (!status) {
    status = cli_measure(&t->config, &t->station, &t->progress, &t->transport, error);
  }
  if (!status) {
    status = clt_transport_save(t->transport, t->output, error);
  }
  if (!status && t->config.acquire.journal != NULL) {
    unlink(t->config.acquire.journal);
  }
  return status;
}

static int answer(const cli_arguments *arguments, const task *t) {
  clt_transport_info info = clt_transport_describe(t->transport);
  const clt_provenance *origin = clt_transport_origin(t->transport);
  if (arguments->json) {
    return cli_print_json(json_pack("{s:s, s:o, s:s, s:I, s:s, s:s, s:i, s:i, s:o, s:o}", "output", t->output, "grid",
                                    cli_json_grid(&(cli_grid){info.width, info.height, info.channels}), "storage",
                                    info.storage, "bytes", (json_int_t)info.bytes, "scheme", origin->scheme, "plan",
                                    origin->plan, "patterns", origin->patterns, "frames", origin->frames, "acquire_s",
                                    cli_json_number(origin->seconds), "error",
                                    origin->error < 0 ? json_null() : cli_json_number(origin->error)));
  }
  if (!arguments->quiet) {
    printf("%s: %d x %d cells, %d channel%s, %s: %d patterns, %d frames, %.1f s", t->output, info.width, info.height,
           info.channels, info.channels == 1 ? "" : "s", origin->scheme, origin->patterns, origin->frames,
           origin->seconds);
    if (origin->error >= 0) {
      printf(", check error %.2f %%", 100 * origin->error);
    }
    putchar('\n');
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  cli_progress_begin(&t.progress, arguments->quiet);
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = measure(&t, &error);
  }
  cli_progress_end(&t.progress);
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  clt_transport_destroy(t.transport);
  clt_station_close(&t.station);
  return code;
}

const cli_command cli_command_acquire = {
    .name = "acquire",
    .synopsis = "--config C | --scene S, -o T.h5 [options]",
    .summary = "measure how the room carries light",
    .options = options,
    .run = run,
    .notes = notes,
};
