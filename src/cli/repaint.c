/* counterlight repaint: how surfaces changed colour, from one photograph, and the room as it looks now. */
#include <stdlib.h>

#include "base/memory.h"
#include "cli/answer.h"
#include "cli/command.h"
#include "cli/light_files.h"
#include "counterlight/analysis.h"

static const cli_option options[] = {
    {"photo", 0, "PIC", "a photograph of the room as it is now"},
    {"drive", 'd', "PIC", "the drive under which it was taken"},
    {"black", 0, "PIC", "a photograph under no drive (default: the transport's black)"},
    {"output", 'o', "OUT", "where the map of new over old reflectance goes (.npy, .exr, .png)"},
    {"predict", 0, "SEEN", "also: what the room now looks like under --light"},
    {"light", 'l', "PIC", "a drive for --predict (default: --drive)"},
    {"calibration", 0, "FILE", "of the rig: the responses by which .png drives are decoded"},
    {"exact-first-bounce", 0, NULL, "F = 1 / (T^-1)_ii in place of diag(T)"},
    {"tolerance", 0, "X", "relative residual of the solves (default 1e-9)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "ratio = K_new / K_old = l / (F x + A l), cell by cell and channel by channel, with T as it was measured before\n"
    "the change. The ratio of a cell that too little light reaches is 1; undetermined counts them. As .png or .jpg "
    "the\n"
    "map is ratio / 2: middle grey is unchanged, white doubled. A .png or .jpg photo is radiance / white.\n"
    "A .png or .jpg drive holds panel values, after the projector's response that the transport file names, or the\n"
    "responses and crosstalk of --calibration.\n"
    "--predict writes b0 + T_new x (.png: over white). Of the photo the black of --black is taken off; without it the\n"
    "transport's, which the repainting may have changed too.\n"
    "With F = diag(T) light that came back to its own cell counts as direct: --exact-first-bounce is free of that and\n"
    "inverts T (at most 6400 lit cells).\n";

typedef struct task {
  const char *photo, *drive_path, *black, *output, *predict, *light_path;
  clt_interreflection_options how;
  cli_input input;
  clt_interreflection *analysis;
  clt_repainted *repainted;
  double *picture, *drive, *light, *ratio, *seen;
  size_t undetermined;
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  clt_status status = cli_required(command, arguments, "photo", &t->photo, error);
  if (!status) {
    status = cli_required(command, arguments, "drive", &t->drive_path, error);
  }
  if (!status) {
    status = cli_required(command, arguments, "output", &t->output, error);
  }
  if (!status) {
    status = cli_picture_output_check(t->output, error);
  }
  t->black = cli_value(command, arguments, "black");
  t->light_path = cli_value(command, arguments, "light");
  t->predict = cli_value(command, arguments, "predict");
  t->how.exact_first_bounce = cli_value(command, arguments, "exact-first-bounce") != NULL;
  if (!status && t->predict) {
    status = cli_picture_output_check(t->predict, error);
  }
  if (!status && t->light_path && !t->predict) {
    status = clt_fail(error, CLT_BAD_INPUT, "--light says what --predict shows; give --predict too");
  }
  return status ? status : cli_number(command, arguments, "tolerance", 1e-14, 0.5, &t->how.tolerance, error);
}

static clt_status read_light(task *t, clt_error *error) {
  clt_status status = cli_drive_values(t->drive_path, &t->input, &t->drive, error);
  if (!status) {
    status = cli_photo_values(t->photo, t->black, &t->input, &t->picture, error);
  }
  if (!status && t->light_path) {
    status = cli_drive_values(t->light_path, &t->input, &t->light, error);
  }
  size_t values = cli_grid_values(&t->input.grid);
  t->ratio = clt_alloc(values, sizeof *t->ratio);
  t->seen = clt_alloc(values, sizeof *t->seen);
  if (!status && (!t->ratio || !t->seen)) {
    status = clt_fail(error, CLT_FAILED, "out of memory for %zu values", values);
  }
  return status;
}

static clt_status find_ratio(task *t, clt_error *error) {
  clt_status status =
      clt_interreflection_create(t->input.transport, t->input.certificate, &t->how, &t->analysis, error);
  if (!status) {
    status = clt_repaint_ratio(t->analysis, t->drive, t->picture, t->ratio, &t->undetermined, error);
  }
  if (status || !t->predict) {
    return status;
  }
  status = clt_repainted_create(t->analysis, t->ratio, &t->repainted, error);
  if (!status) {
    status = clt_repainted_apply(t->repainted, t->light ? t->light : t->drive, t->seen, error);
  }
  const cli_grid *grid = &t->input.grid;
  size_t values = cli_grid_values(grid), cells = values / (size_t)grid->channels;
  for (size_t i = 0; !status && i < values; i++) {
    t->seen[i] += (double)clt_transport_black(t->input.transport, (int)(i / cells))[i % cells];
  }
  return status;
}

static clt_status write_picture(const char *path, const double *values, const task *t, const double *white,
                                clt_error *error) {
  clt_image image = {0};
  clt_status status = cli_values_image(values, &t->input.grid, &image, error);
  if (!status) {
    status = cli_radiance_write(path, &image, white, error);
  }
  clt_image_finish(&image);
  return status;
}

static clt_status write_results(const task *t, clt_error *error) {
  static const double doubled[CLT_CHANNELS_MAX] = {2, 2, 2, 2};
  clt_status status = write_picture(t->output, t->ratio, t, doubled, error);
  return status || !t->predict ? status : write_picture(t->predict, t->seen, t, t->input.white, error);
}

/* The least and the greatest ratio of a channel. */
static void find_range(const task *t, int channel, double range[2]) {
  size_t cells = cli_grid_values(&t->input.grid) / (size_t)t->input.grid.channels;
  const double *ratio = t->ratio + (size_t)channel * cells;
  range[0] = range[1] = ratio[0];
  for (size_t i = 1; i < cells; i++) {
    range[0] = ratio[i] < range[0] ? ratio[i] : range[0];
    range[1] = ratio[i] > range[1] ? ratio[i] : range[1];
  }
}

static int answer(const cli_arguments *arguments, const task *t) {
  clt_interreflection_info info = clt_interreflection_describe(t->analysis);
  json_t *ranges = json_array();
  for (int c = 0; c < t->input.grid.channels; c++) {
    double range[2];
    find_range(t, c, range);
    json_array_append_new(ranges, cli_json_numbers(range, 2));
    if (!arguments->json && !arguments->quiet) {
      printf("%s: channel %d reflects %.4g to %.4g times what it did\n", t->output, c, range[0], range[1]);
    }
  }
  if (!arguments->json && !arguments->quiet && t->undetermined > 0) {
    printf("%zu values get too little light to tell\n", t->undetermined);
  }
  json_t *document =
      json_pack("{s:s, s:s*, s:o, s:o, s:I, s:s, s:b, s:s, s:o}", "output", t->output, "predict", t->predict, "grid",
                cli_json_grid(&t->input.grid), "ranges", ranges, "undetermined", (json_int_t)t->undetermined,
                "first_bounce", info.exact_first_bounce ? "exact" : "diagonal", "inexact", info.inexact, "why",
                info.why, "white", cli_json_numbers(t->input.white, t->input.grid.channels));
  if (arguments->json) {
    return cli_print_json(document);
  }
  json_decref(document);
  return CLI_DONE;
}

static void finish(task *t) {
  clt_repainted_destroy(t->repainted);
  clt_interreflection_destroy(t->analysis);
  free(t->picture);
  free(t->drive);
  free(t->light);
  free(t->ratio);
  free(t->seen);
  cli_input_close(&t->input);
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = cli_input_open(arguments->positional[0], &t.input, &error);
  }
  if (!status) {
    status = cli_input_check_lit(&t.input, arguments->positional[0], &error);
  }
  if (!status) {
    status = cli_input_calibrate(cli_value(command, arguments, "calibration"), &t.input, &error);
  }
  if (!status) {
    status = read_light(&t, &error);
  }
  if (!status) {
    status = find_ratio(&t, &error);
  }
  if (!status) {
    status = write_results(&t, &error);
  }
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  finish(&t);
  return code;
}

const cli_command cli_command_repaint = {
    .name = "repaint",
    .synopsis = "T.h5 --photo PIC --drive PIC -o OUT [options]",
    .summary = "find how surfaces changed colour, from one photograph",
    .options = options,
    .positional_least = 1,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
