/* counterlight separate: direct and global light of a room, by shifted checkerboards. */

#include "base/clock.h"
#include "base/file.h"
#include "base/order.h"
#include "cli/answer.h"
#include "cli/command.h"
#include "cli/folder.h"
#include "cli/light_files.h"
#include "cli/measure.h"
#include "cli/progress.h"
#include "counterlight/analysis.h"
#include "counterlight/station.h"

static const cli_option options[] = {
    {"config", 'c', "C", "configuration that names the devices"},
    {"scene", 's', "S", "scene file: simulated devices"},
    {"output", 'o', "DIR", "where the pictures go"},
    {"drive-level", 0, "X", "drive of the squares that are on, above 0..1 (default 1)"},
    {"square", 0, "N", "side of the squares in cells, 1..16 (default: 2, or 4 where that blurs)"},
    {"step", 0, "N", "cells by which the pattern is shifted (default: half a square)"},
    {"repeats", 0, "N", "observations of each pattern, 1..64 (default 1)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Observes black, a flood and shifted checkerboards (Nayar et al. 2006); no transport is needed. Leaves direct\n"
    "and global, the light of a fully driven picture, in DIR, each as .exr (radiance less black) and .png (radiance\n"
    "over white, the median direct light), their standard deviations as .exr, and summary.json.\n"
    "Squares must be larger than what blurs the picture and smaller than what changes in the global light: without\n"
    "--square 2 and 4 cells are observed, and 2 is taken where its contrast is that of 4. closure is ||direct + global "
    "- flood|| / ||flood||, closure_noise what noise explains of it; a "
    "closure\n"
    "well above that says that light does not add up: a wrong response curve, or a lamp that drifts.\n";

typedef struct task {
  const char *output;
  char folder[CLT_PATH_MAX];
  clt_station_config config;
  clt_station station;
  clt_separation_options how;
  clt_separation light;
  cli_grid grid;
  double white[CLT_CHANNELS_MAX];
  cli_progress progress;
  int64_t start_ns;
  long frames;
} task;

static bool show_progress(void *context, long done, long total) {
  task *t = context;
  double seconds = clt_clock_since(t->start_ns);
  clt_progress state = {.phase = "squares",
                        .done = done,
                        .total = total,
                        .seconds = seconds,
                        .left = seconds / (double)done * (double)(total - done)};
  return cli_progress_acquire(&t->progress, &state);
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  const char *config = cli_value(command, arguments, "config"), *scene = cli_value(command, arguments, "scene");
  clt_status status = cli_required(command, arguments, "output", &t->output, error);
  if (!status && (config != NULL) == (scene != NULL)) {
    status = clt_fail(error, CLT_BAD_INPUT, "give either --config or --scene; usage: counterlight separate %s",
                      command->synopsis);
  }
  if (!status) {
    status = cli_number(command, arguments, "drive-level", 1e-3, 1, &t->how.level, error);
  }
  if (!status) {
    status = cli_integer(command, arguments, "square", 1, 16, &t->how.square, error);
  }
  if (!status) {
    status = cli_integer(command, arguments, "step", 1, 16, &t->how.step, error);
  }
  if (!status) {
    status = cli_integer(command, arguments, "repeats", 1, 64, &t->how.repeats, error);
  }
  if (!status) {
    status = cli_folder_choose(t->output, NULL, t->folder, error);
  }
  t->how.progress = show_progress;
  t->how.context = t;
  if (status) {
    return status;
  }
  return config ? clt_station_read(config, &t->config, error) : clt_station_for_scene(scene, &t->config, error);
}

static clt_status measure(task *t, clt_error *error) {
  clt_status status = cli_station_open(&t->config, &t->progress, &t->station, error);
  if (status) {
    return status;
  }
  clt_rig_info info;
  t->start_ns = clt_clock_ns();
  status = clt_separate(t->station.rig, &t->how, &t->light, error);
  t->station.rig->operations->describe(t->station.rig, &info);
  t->grid = (cli_grid){info.width, info.height, info.channels};
  t->frames = info.frames;
  return status == CLT_CANCELLED ? clt_fail(error, CLT_CANCELLED, "interrupted; nothing was written") : status;
}

/* The median direct light of each channel, of the cells with any that stands out of the noise. */
static clt_status find_white(task *t, clt_error *error) {
  clt_image sorted = {0};
  clt_status status = clt_image_init(&sorted, 1, t->grid.height, t->grid.width, error);
  size_t cells = clt_image_size(&sorted);
  for (int c = 0; !status && c < t->grid.channels; c++) {
    size_t count = 0;
    for (size_t i = (size_t)c * cells; i < (size_t)(c + 1) * cells; i++) {
      if (t->light.direct.data[i] > 5 * t->light.direct_deviation.data[i]) {
        sorted.data[count++] = t->light.direct.data[i];
      }
    }
    clt_sort_floats(sorted.data, count);
    t->white[c] = count > 0 && sorted.data[count / 2] > 0 ? (double)sorted.data[count / 2] : 1;
  }
  clt_image_finish(&sorted);
  return status;
}

static clt_status write_pictures(const task *t, clt_error *error) {
  const struct {
    const char *name;
    const clt_image *image;
  } pictures[] = {{"direct.exr", &t->light.direct},
                  {"direct.png", &t->light.direct},
                  {"global.exr", &t->light.global},
                  {"global.png", &t->light.global},
                  {"direct-deviation.exr", &t->light.direct_deviation},
                  {"global-deviation.exr", &t->light.global_deviation}};
  clt_status status = cli_folder_make(t->folder, error);
  for (size_t i = 0; !status && i < sizeof pictures / sizeof *pictures; i++) {
    char path[CLT_PATH_MAX];
    status = clt_file_join(t->folder, pictures[i].name, path, error);
    if (!status) {
      status = cli_radiance_write(path, pictures[i].image, t->white, error);
    }
  }
  return status;
}

static double sum_of(const clt_image *image) {
  double sum = 0;
  for (size_t i = 0; i < clt_image_size(image); i++) {
    sum += image->data[i];
  }
  return sum;
}

static json_t *summary(const task *t) {
  const clt_separation *light = &t->light;
  double direct = sum_of(&light->direct), global = sum_of(&light->global);
  return json_pack("{s:s, s:o, s:i, s:i, s:o, s:f, s:f, s:f, s:i, s:o, s:o, s:f, s:f, s:i}", "output", t->folder,
                   "grid", cli_json_grid(&t->grid), "patterns", (int)light->patterns, "frames", (int)t->frames, "white",
                   cli_json_numbers(t->white, t->grid.channels), "direct_energy", direct, "global_energy", global,
                   "active", light->active, "square", light->square, "contrast",
                   light->contrast > 0 ? cli_json_number(light->contrast) : json_null(), "global_share",
                   cli_json_number(global / (direct + global)), "closure", light->closure, "closure_noise",
                   light->closure_noise, "unseen", (int)light->unseen);
}

static clt_status conclude(const cli_arguments *arguments, task *t, clt_error *error) {
  clt_status status = find_white(t, error);
  if (!status) {
    status = write_pictures(t, error);
  }
  if (status) {
    return status;
  }
  json_t *document = summary(t);
  status = cli_summary_write(t->folder, document, error);
  if (!status && arguments->json) {
    return cli_print_json(document) == CLI_DONE ? CLT_OK : clt_fail(error, CLT_FAILED, "stdout cannot be written");
  }
  json_decref(document);
  if (!status && !arguments->quiet) {
    double direct = sum_of(&t->light.direct), global = sum_of(&t->light.global);
    printf("%s: %.2f %% of the light is global, by squares of %d cells, %ld patterns; direct + global meet the "
           "flood to %.2f %% (noise %.2f %%)\n",
           t->folder, 100 * global / (direct + global), t->light.square, t->light.patterns, 100 * t->light.closure,
           100 * t->light.closure_noise);
  }
  return status;
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
  if (!status) {
    status = conclude(arguments, &t, &error);
  }
  int code = status ? cli_fail(command, &error) : CLI_DONE;
  clt_separation_finish(&t.light);
  clt_station_close(&t.station);
  return code;
}

const cli_command cli_command_separate = {
    .name = "separate",
    .synopsis = "--config C | --scene S, -o DIR [options]",
    .summary = "tell direct from global light by shifted checkerboards",
    .options = options,
    .run = run,
    .notes = notes,
};
