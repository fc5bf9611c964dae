/* counterlight compensate: the drive that makes a picture appear. */
#include "cli/answer.h"
#include "cli/command.h"
#include "cli/optical.h"
#include "cli/solve_options.h"
#include "cli/transport_input.h"

static const cli_option options[] = {
    {"target", 't', "PIC", "the picture to make appear"},
    {"output", 'o', "OUT", "where the drive goes (.png, .exr, .npy)"},
    {"method", 'm', "NAME", "auto (the default) or a solver's name"},
    {"tolerance", 0, "X", "relative residual to stop at (default 1e-4)"},
    {"deadline-ms", 0, "X", "stop after this time with the best drive so far"},
    {"white", 'w', "W", "radiance of the picture's white: a number, auto or feasible"},
    {"predict", 'p', "SEEN", "also write what the drive will look like"},
    {"config", 'c', "C", "no transport: solve through the rig that this configuration names"},
    {"scene", 's', "S", "no transport: solve through simulated devices in this scene"},
    {"calibration", 0, "FILE", "of the rig: the responses by which a .png drive is encoded"},
    {"photographs", 0, "N", "through a rig: at most so many (4..1000, default 40)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "The picture is resampled to the transport's grid (a .npy must fit exactly) and read as linear light;\n"
    "its white means the radiance --white: auto is the median of the direct light of a fully driven cell,\n"
    "feasible the largest that every cell can reach.\n"
    "A .png drive holds panel values, after the projector's response curve that the transport file names (sRGB\n"
    "where it names none), or after the responses and crosstalk of --calibration; .exr and .npy hold linear light.\n"
    "--predict writes b0 + T x: divided by white and sRGB-encoded as .png or .jpg, so that it compares\n"
    "with the picture by eye; the radiance itself as .exr or .npy.\n"
    "With --config or --scene there is no transport: the room itself makes the products, a photograph each, and\n"
    "--tolerance (default 5e-3) counts over the cells that can follow. Errors are then as photographed.\n"
    "Errors are relative RMS over the lit cells in linear light; error_after is that of the drive as written\n"
    "(a .png rounds it to 8 bits), error_limit the least that any drive in 0..1 can reach.\n";

typedef struct task {
  const char *target, *output, *predict, *calibration;
  clt_solve_options solve;
  clt_white white;
  cli_input input;
  clt_image picture, drive, seen;
  clt_compensation result;
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  clt_status status = cli_required(command, arguments, "target", &t->target, error);
  if (!status) {
    status = cli_required(command, arguments, "output", &t->output, error);
  }
  if (!status) {
    status = cli_picture_output_check(t->output, error);
  }
  t->calibration = cli_value(command, arguments, "calibration");
  t->predict = cli_value(command, arguments, "predict");
  if (!status && t->predict) {
    status = cli_picture_output_check(t->predict, error);
  }
  return status ? status : cli_solve_options(command, arguments, &t->solve, &t->white, error);
}

static clt_status solve(const char *transport, task *t, clt_error *error) {
  clt_status status = cli_input_open(transport, &t->input, error);
  if (!status) {
    status = cli_input_check_lit(&t->input, transport, error);
  }
  if (!status) {
    status = cli_input_calibrate(t->calibration, &t->input, error);
  }
  if (!status) {
    status = cli_input_check_drive(&t->input, t->output, error);
  }
  if (!status) {
    status = cli_picture_read(t->target, NULL, &t->input.grid, &t->picture, error);
  }
  if (!status) {
    status = clt_compensate(t->input.transport, t->input.certificate, &t->picture, &t->white, &t->solve, true,
                            &t->drive, &t->result, error);
  }
  return status;
}

/* Judges the drive as it was written: a .png rounds it to 8 bits, a .jpg does worse. */
static clt_status judge_written(task *t, clt_error *error) {
  double white[CLT_CHANNELS_MAX];
  clt_image target = {0};
  clt_image_finish(&t->drive);
  clt_status status = cli_picture_read(t->output, &t->input.panel, &t->input.grid, &t->drive, error);
  if (!status) {
    status = clt_predict(t->input.transport, &t->drive, &t->seen, error);
  }
  if (!status) {
    status = clt_target(t->input.transport, t->input.certificate, &t->picture, &t->white, &target, white, error);
  }
  if (!status) {
    t->result.error_after = clt_appearance_error(t->input.certificate, &t->seen, &target, false);
  }
  clt_image_finish(&target);
  return status;
}

static clt_status write_pictures(task *t, clt_error *error) {
  clt_status status = clt_panel_write(t->output, &t->input.panel, &t->drive, error);
  if (!status) {
    status = judge_written(t, error);
  }
  if (!status && t->predict) {
    status = cli_radiance_write(t->predict, &t->seen, t->result.white, error);
  }
  return status;
}

static void finish(task *t) {
  clt_image_finish(&t->picture);
  clt_image_finish(&t->drive);
  clt_image_finish(&t->seen);
  cli_input_close(&t->input);
}

static int answer(const cli_arguments *arguments, const task *t) {
  const clt_compensation *r = &t->result;
  if (arguments->json) {
    json_t *document = json_pack("{s:s, s:o}", "output", t->output, "grid", cli_json_grid(&t->input.grid));
    cli_json_add_compensation(document, r, t->input.grid.channels);
    return cli_print_json(document);
  }
  if (!arguments->quiet) {
    printf("%s: %.2f %% off (%.2f %% without compensation; no drive can do better than %.2f %%)\n", t->output,
           100 * r->error_after, 100 * r->error_before, 100 * r->error_limit);
    printf("%s, %d iterations, %.1f ms: %s\n", r->solve.method, r->solve.iterations, 1e3 * r->solve.seconds,
           r->solve.reason);
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  if (cli_value(command, arguments, "config") != NULL || cli_value(command, arguments, "scene") != NULL) {
    return cli_compensate_optically(command, arguments);
  }
  task t = {0};
  clt_error error = {0};
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = arguments->positional_count > 0
                 ? solve(arguments->positional[0], &t, &error)
                 : clt_fail(&error, CLT_BAD_INPUT, "give a transport file, --config or --scene; usage: counterlight %s",
                            command->synopsis);
  }
  if (!status) {
    status = write_pictures(&t, &error);
  }
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  finish(&t);
  return code;
}

const cli_command cli_command_compensate = {
    .name = "compensate",
    .synopsis = "T.h5 | --config C | --scene S, --target PIC -o OUT [options]",
    .summary = "compute the drive that makes a picture appear",
    .options = options,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
