/* counterlight relight: what the room looks like under a drive, or the projector's view of light from the camera. */
#include "cli/answer.h"
#include "cli/command.h"
#include "cli/relight_forward.h"
#include "counterlight/analysis.h"

static const cli_option options[] = {
    {"light", 'l', "PIC", "the drive, or with --dual the light at the camera"},
    {"output", 'o', "OUT", "where the picture goes (.png, .exr, .npy)"},
    {"dual", 0, NULL, "transposed product: the view from the projector"},
    {"forward", 0, "METHOD", "build the light from A = I - F T^-1: series, iteration or montecarlo"},
    {"bounces", 'n', "K", "series: bounces to add, 0..1000 (default 8)"},
    {"tolerance", 0, "X", "iteration: stop when a bounce adds less of the direct light (default 1e-6)"},
    {"samples", 0, "N", "montecarlo: paths of each cell (default 64)"},
    {"seed", 0, "N", "montecarlo: of the paths (default 0)"},
    {"exact-first-bounce", 0, NULL, "with --forward: F = 1 / (T^-1)_ii in place of diag(T)"},
    {"calibration", 0, "FILE", "of the rig: the responses by which a .png drive is decoded"},
    {"scale", 0, "X", "radiance of white in a .png (default: the median direct light)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Writes b0 + T x, with --dual T' x (Helmholtz reciprocity: lit from the camera, seen by the projector).\n"
    "A .png or .jpg light holds panel values and is decoded by the projector's response curve that the\n"
    "transport file names (sRGB where it names none, and with --dual), or by --calibration; .exr and .npy are linear.\n"
    "With --forward l_out = (I - A)^-1 F x comes by the series, the iteration or the paths of Bai et al. 2010 (eq. "
    "14,\n"
    "41, 46), and how far it is from T x is told; montecarlo inverts T (at most 6400 lit cells) and tells its "
    "standard\n"
    "error.\n"
    "A .png result is divided by white (--scale) and sRGB-encoded; .exr and .npy hold the radiance.\n";

typedef struct task {
  const char *light, *output;
  bool dual;
  cli_forward forward;
  cli_input input;
  clt_image drive, seen;
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  clt_status status = cli_required(command, arguments, "light", &t->light, error);
  if (!status) {
    status = cli_required(command, arguments, "output", &t->output, error);
  }
  t->dual = cli_value(command, arguments, "dual") != NULL;
  if (!status) {
    status = cli_forward_read(command, arguments, &t->forward, error);
  }
  if (!status && t->dual && t->forward.method) {
    status = clt_fail(error, CLT_BAD_INPUT, "--forward and --dual exclude each other: T' is one product");
  }
  return status ? status : cli_picture_output_check(t->output, error);
}

static clt_status relight(task *t, clt_error *error) {
  const clt_panel *panel = t->dual ? NULL : &t->input.panel;
  clt_status status = t->dual ? CLT_OK : cli_input_check_drive(&t->input, t->light, error);
  if (!status) {
    status = cli_picture_read(t->light, panel, &t->input.grid, &t->drive, error);
  }
  if (status) {
    return status;
  }
  if (t->forward.method) {
    return cli_forward_relight(&t->forward, &t->input, &t->drive, &t->seen, error);
  }
  return t->dual ? clt_dual_photograph(t->input.transport, &t->drive, &t->seen, error)
                 : clt_predict(t->input.transport, &t->drive, &t->seen, error);
}

static clt_status write_result(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  double scale = 0;
  clt_status status = cli_number(command, arguments, "scale", 1e-30, 1e30, &scale, error);
  for (int c = 0; scale > 0 && c < t->input.grid.channels; c++) {
    t->input.white[c] = scale;
  }
  return status ? status : cli_radiance_write(t->output, &t->seen, t->input.white, error);
}

static int answer(const cli_arguments *arguments, const task *t) {
  if (arguments->json) {
    json_t *document =
        json_pack("{s:s, s:b, s:o, s:o}", "output", t->output, "dual", t->dual, "grid", cli_json_grid(&t->input.grid),
                  "white", cli_json_numbers(t->input.white, t->input.grid.channels));
    if (t->forward.method) {
      json_object_set_new(document, "forward", cli_forward_json(&t->forward));
    }
    return cli_print_json(document);
  }
  if (!arguments->quiet) {
    printf("%s: %s\n", t->output, t->dual ? "the projector's view, T' x" : "what the room looks like, b0 + T x");
  }
  if (!arguments->quiet && t->forward.method) {
    cli_forward_print(&t->forward);
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = cli_input_open(arguments->positional[0], &t.input, &error);
  }
  if (!status) {
    status = cli_input_calibrate(cli_value(command, arguments, "calibration"), &t.input, &error);
  }
  if (!status) {
    status = relight(&t, &error);
  }
  if (!status) {
    status = write_result(command, arguments, &t, &error);
  }
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  clt_image_finish(&t.drive);
  clt_image_finish(&t.seen);
  cli_input_close(&t.input);
  return code;
}

const cli_command cli_command_relight = {
    .name = "relight",
    .synopsis = "T.h5 --light PIC -o OUT [--dual | --forward METHOD]",
    .summary = "light the measured room with a picture; --dual: the projector's view",
    .options = options,
    .positional_least = 1,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
