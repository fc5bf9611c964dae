/* counterlight bounces: a picture taken apart into direct light and bounces. */
#include <stdlib.h>
#include <string.h>

#include "cli/answer.h"
#include "cli/command.h"
#include "cli/folder.h"
#include "cli/light_files.h"
#include "counterlight/analysis.h"

static const cli_option options[] = {
    {"drive", 'd', "PIC", "the drive whose light is taken apart"},
    {"photo", 0, "PIC", "a photograph of the room instead"},
    {"bounces", 'n', "K", "bounces after the direct light, 0..64 (default 4)"},
    {"output", 'o', "DIR", "where the pictures go"},
    {"calibration", 0, "FILE", "of the rig: the responses by which a .png drive is decoded"},
    {"exact-first-bounce", 0, NULL, "F = 1 / (T^-1)_ii in place of diag(T)"},
    {"tolerance", 0, "X", "relative residual of each solve (default 1e-9)"},
    {"method", 0, "NAME", "of the solves (default: pcg, or gmres where T is not reciprocal)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Leaves direct, bounce-1 .. bounce-K, rest (all later bounces) and picture (their sum) in DIR, each as .exr\n"
    "(radiance less black) and as .png (radiance * gain / white, sRGB-encoded), and summary.json, which has the gain\n"
    "of each. A .png or .jpg drive holds panel values, after the projector's response that the transport file names,\n"
    "or the responses and crosstalk of --calibration; a .png or .jpg photo is radiance / white, .exr and .npy are\n"
    "linear. Of a photo the transport's black is taken off.\n"
    "energy is the sum over cells and channels, share its part of the picture's, negative the part of a term's\n"
    "magnitude that lies below 0, sum_error ||direct + bounces + rest - picture|| / ||picture||. eq51_difference is\n"
    "how far bounce k by l_d - S^-1 (direct + ... + bounce k-1) (Bai et al. 2010, eq. 51) is from the one here.\n"
    "--exact-first-bounce takes out of F the light that came back to its own cell; it inverts T (at most 6400 lit\n"
    "cells). inexact says that the scene is none of flat diffuse patches, and why.\n";

typedef struct task {
  const char *drive_path, *photo_path, *output, *calibration;
  char folder[CLT_PATH_MAX];
  int count;
  clt_interreflection_options how;
  cli_input input;
  clt_interreflection *analysis;
  double *light;
  clt_bounces bounces;
  double gain[CLT_BOUNCES_MAX + 1], rest_gain, picture_gain, difference[CLT_BOUNCES_MAX + 1];
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  t->drive_path = cli_value(command, arguments, "drive");
  t->photo_path = cli_value(command, arguments, "photo");
  t->calibration = cli_value(command, arguments, "calibration");
  t->how.exact_first_bounce = cli_value(command, arguments, "exact-first-bounce") != NULL;
  t->how.method = cli_value(command, arguments, "method");
  t->count = 4;
  clt_status status = cli_required(command, arguments, "output", &t->output, error);
  if (!status && (t->drive_path != NULL) == (t->photo_path != NULL)) {
    status = clt_fail(error, CLT_BAD_INPUT, "give either --drive or --photo; usage: counterlight bounces %s",
                      command->synopsis);
  }
  if (!status) {
    status = cli_integer(command, arguments, "bounces", 0, CLT_BOUNCES_MAX, &t->count, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "tolerance", 1e-14, 0.5, &t->how.tolerance, error);
  }
  return status ? status : cli_folder_choose(t->output, NULL, t->folder, error);
}

static clt_status take_apart(task *t, bool compare, clt_error *error) {
  clt_status status = t->drive_path ? cli_drive_values(t->drive_path, &t->input, &t->light, error)
                                    : cli_photo_values(t->photo_path, NULL, &t->input, &t->light, error);
  if (!status) {
    status = clt_interreflection_create(t->input.transport, t->input.certificate, &t->how, &t->analysis, error);
  }
  if (!status) {
    status = t->drive_path ? clt_bounces_of_drive(t->analysis, t->light, t->count, &t->bounces, error)
                           : clt_bounces_of_picture(t->analysis, t->light, t->count, &t->bounces, error);
  }
  return status || !compare ? status : clt_bounces_compare_sums(t->analysis, &t->bounces, t->difference, error);
}

static void term_name(int k, char name[32]) {
  if (k == 0) {
    strcpy(name, "direct");
  } else {
    snprintf(name, 32, "bounce-%d", k);
  }
}

/* The picture and its direct light share one gain, so that they compare. */
static clt_status write_pictures(task *t, clt_error *error) {
  const cli_grid *grid = &t->input.grid;
  const double *white = t->input.white;
  size_t values = cli_grid_values(grid);
  t->picture_gain = cli_light_gain(t->bounces.picture, grid, white);
  t->rest_gain = cli_light_gain(t->bounces.rest, grid, white);
  clt_status status = cli_folder_make(t->folder, error);
  for (int k = 0; !status && k <= t->count; k++) {
    char name[32];
    const double *light = t->bounces.light + (size_t)k * values;
    term_name(k, name);
    t->gain[k] = k > 0 ? cli_light_gain(light, grid, white) : t->picture_gain;
    status = cli_light_write(t->folder, name, light, grid, white, t->gain[k], error);
  }
  if (!status) {
    status = cli_light_write(t->folder, "rest", t->bounces.rest, grid, white, t->rest_gain, error);
  }
  return status ? status
                : cli_light_write(t->folder, "picture", t->bounces.picture, grid, white, t->picture_gain, error);
}

static double sum_of(const double *values, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; i++) {
    sum += values[i];
  }
  return sum;
}

static json_t *terms_json(const task *t, bool compared) {
  json_t *terms = json_array();
  size_t values = cli_grid_values(&t->input.grid);
  for (int k = 0; k <= t->count; k++) {
    const clt_bounce_figures *figures = &t->bounces.figures[k];
    char name[32];
    term_name(k, name);
    json_t *term = json_pack("{s:s, s:i, s:f, s:f, s:f, s:f, s:f}", "name", name, "bounce", k, "energy",
                             sum_of(t->bounces.light + (size_t)k * values, values), "share", figures->share, "negative",
                             figures->negative, "residual", figures->residual, "gain", t->gain[k]);
    if (compared && k > 0) {
      json_object_set_new(term, "eq51_difference", cli_json_number(t->difference[k]));
    }
    json_array_append_new(terms, term);
  }
  return terms;
}

static json_t *summary(const task *t, bool compared) {
  clt_interreflection_info info = clt_interreflection_describe(t->analysis);
  size_t values = cli_grid_values(&t->input.grid);
  json_t *document =
      json_pack("{s:s, s:o, s:i, s:s, s:s, s:o, s:o, s:f}", "output", t->folder, "grid", cli_json_grid(&t->input.grid),
                "bounces", t->count, "first_bounce", info.exact_first_bounce ? "exact" : "diagonal", "method",
                info.method, "white", cli_json_numbers(t->input.white, t->input.grid.channels), "terms",
                terms_json(t, compared), "sum_error", t->bounces.sum_error);
  json_object_set_new(document, "rest",
                      json_pack("{s:f, s:f, s:f}", "energy", sum_of(t->bounces.rest, values), "share",
                                t->bounces.rest_share, "gain", t->rest_gain));
  json_object_set_new(document, "picture",
                      json_pack("{s:f, s:f}", "energy", sum_of(t->bounces.picture, values), "gain", t->picture_gain));
  json_object_set_new(document, "inexact", json_boolean(info.inexact));
  json_object_set_new(document, "why", json_string(info.why));
  json_object_set_new(document, "spread", json_real(info.spread));
  json_object_set_new(document, "reciprocity_defect", cli_json_number(info.reciprocity));
  return document;
}

static void print_terms(const task *t) {
  clt_interreflection_info info = clt_interreflection_describe(t->analysis);
  for (int k = 0; k <= t->count; k++) {
    char name[32];
    term_name(k, name);
    printf("%-10s %8.4f %% of the picture's light, .png * %g\n", name, 100 * t->bounces.figures[k].share, t->gain[k]);
  }
  printf("%-10s %8.4f %%, .png * %g; the terms sum to the picture to %.1e\n", "rest", 100 * t->bounces.rest_share,
         t->rest_gain, t->bounces.sum_error);
  if (info.inexact) {
    printf("inexact: %s\n", info.why);
  }
}

static clt_status run_task(const cli_arguments *arguments, task *t, clt_error *error) {
  clt_status status = cli_input_open(arguments->positional[0], &t->input, error);
  if (!status) {
    status = cli_input_check_lit(&t->input, arguments->positional[0], error);
  }
  if (!status) {
    status = cli_input_calibrate(t->calibration, &t->input, error);
  }
  if (!status) {
    status = take_apart(t, arguments->json, error);
  }
  if (!status) {
    status = write_pictures(t, error);
  }
  if (status) {
    return status;
  }
  json_t *document = summary(t, arguments->json);
  status = cli_summary_write(t->folder, document, error);
  if (!status && arguments->json) {
    return cli_print_json(document) == CLI_DONE ? CLT_OK : clt_fail(error, CLT_FAILED, "stdout cannot be written");
  }
  json_decref(document);
  if (!status && !arguments->quiet) {
    print_terms(t);
  }
  return status;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  task *t = calloc(1, sizeof *t);
  clt_error error = {0};
  clt_status status = t ? read_options(command, arguments, t, &error) : clt_fail(&error, CLT_FAILED, "out of memory");
  if (!status) {
    status = run_task(arguments, t, &error);
  }
  int code = status ? cli_fail(command, &error) : CLI_DONE;
  if (t) {
    clt_bounces_finish(&t->bounces);
    clt_interreflection_destroy(t->analysis);
    free(t->light);
    cli_input_close(&t->input);
  }
  free(t);
  return code;
}

const cli_command cli_command_bounces = {
    .name = "bounces",
    .synopsis = "T.h5 --drive PIC | --photo PIC, -o DIR [-n K] [options]",
    .summary = "take a picture apart into direct light and each bounce",
    .options = options,
    .positional_least = 1,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
