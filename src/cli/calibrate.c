/* counterlight calibrate: the geometry of a rig by structured light, from a replay. */
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "cli/answer.h"
#include "cli/calibrate_report.h"
#include "cli/command.h"
#include "cli/folder.h"
#include "cli/progress.h"
#include "counterlight/replay.h"

#define ANY_EXPOSURE_S 0.01 /* pictures have whatever is asked for */

static const cli_option options[] = {
    {"replay", 0, "DIR", "a recording, a folder of pictures, or a list of them"},
    {"panel", 0, "WxH", "the panel's pixels (a recording knows them; default 1280x720)"},
    {"reference", 0, "FILE", "calibration (OpenCV's YAML) to check against"},
    {"response", 0, "CURVE", "the camera's: linear, srgb or gamma:G (default: srgb for pictures)"},
    {"exposure-ms", 0, "X", "exposure time of the recorded frames to take (default: the longest)"},
    {"output", 'o', "DIR", "where map.npy, coverage.png and summary.json go (default calibration)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Decodes Gray code pictures with their inverses (columns from the coarsest bit, then rows) to the panel "
    "coordinate\n"
    "that each camera pixel sees. map.npy holds x, y and confidence, float32 [3, height, width], NaN where masked: "
    "panel\n"
    "pixel k spans [k, k + 1). coverage.png shows decoded pixels by their place on the panel, and masked ones by "
    "cause:\n"
    "black unlit, white saturated, blue ambiguous, magenta outside the panel, yellow isolated, cyan lit from two "
    "places.\n"
    "Distances are those of camera pixels from the epipolar lines of --reference, or without one of the map's own\n"
    "fundamental matrix. What is wrong and what to do is printed line by line.\n";

typedef struct task {
  const char *replay, *reference;
  clt_stereo stereo; /* of the reference */
  char folder[CLT_PATH_MAX];
  int panel_width, panel_height;
  clt_curve response;
  bool response_given;
  double exposure_s;
  clt_projector *projector;
  clt_camera *camera;
  clt_geometry_options how;
  cli_calibration found;
  cli_progress progress;
} task;

static clt_status read_panel(const char *text, task *t, clt_error *error) {
  int end = 0;
  if (sscanf(text, "%dx%d%n", &t->panel_width, &t->panel_height, &end) != 2 || text[end] != '\0') {
    return clt_fail(error, CLT_BAD_INPUT, "--panel: '%s' is no size; give it like 1280x720", text);
  }
  return CLT_OK;
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  const char *panel = cli_value(command, arguments, "panel"), *curve = cli_value(command, arguments, "response");
  double exposure_ms = 0;
  clt_status status = cli_required(command, arguments, "replay", &t->replay, error);
  t->reference = cli_value(command, arguments, "reference");
  t->panel_width = 1280;
  t->panel_height = 720;
  if (!status && panel != NULL) {
    status = read_panel(panel, t, error);
  }
  if (!status && curve != NULL) {
    t->response_given = true;
    status = clt_curve_parse(curve, &t->response, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "exposure-ms", 1e-3, 1e6, &exposure_ms, error);
    t->exposure_s = exposure_ms * 1e-3;
  }
  if (!status) {
    status = cli_folder_choose(cli_value(command, arguments, "output"), "calibration", t->folder, error);
  }
  return status;
}

static bool show_progress(void *context, int done, int total) {
  task *t = context;
  char note[64];
  snprintf(note, sizeof note, "picture %d of %d", done, total);
  cli_progress_note(&t->progress, note);
  return !cli_interrupted();
}

static clt_status open_recording(task *t, clt_error *error) {
  clt_projector_info panel;
  double longest_s = 0;
  clt_status status = clt_replay_longest_exposure(t->replay, &longest_s, error);
  if (!status) {
    status = clt_replay_open(t->replay, &t->projector, &t->camera, error);
  }
  if (status) {
    return status;
  }
  t->projector->driver->describe(t->projector, &panel);
  t->how.exposure_s = t->exposure_s > 0 ? t->exposure_s : longest_s;
  return clt_gray_init(&t->how.gray, panel.width, panel.height, error);
}

static clt_status open_pictures(task *t, clt_error *error) {
  int pictures = 0;
  clt_status status =
      clt_replay_open_pictures(t->replay, t->panel_width, t->panel_height, &t->projector, &t->camera, &pictures, error);
  t->how.exposure_s = t->exposure_s > 0 ? t->exposure_s : ANY_EXPOSURE_S;
  t->response = t->response_given ? t->response : (clt_curve){.kind = CLT_CURVE_SRGB};
  return status ? status : clt_gray_init_counted(&t->how.gray, t->panel_width, t->panel_height, pictures, error);
}

/* A map that cannot be checked is still a map. */
static void check_epipolar(task *t) {
  clt_error error = {0};
  if (t->found.geometry.decode.count[CLT_PIXEL_DECODED] == 0) {
    return; /* findings say so */
  }
  cli_progress_note(&t->progress, "epipolar distances");
  if (clt_epipolar_check(&t->found.geometry.map, t->reference != NULL ? &t->stereo : NULL, &t->found.epipolar,
                         &error)) {
    clt_findings_add(&t->found.findings, false, "the map was not checked: %s", error.message);
  }
}

static clt_status measure(task *t, clt_error *error) {
  clt_shots shots;
  clt_status status = t->reference != NULL ? clt_stereo_read(t->reference, &t->stereo, error) : CLT_OK;
  if (!status) {
    status = clt_replay_is_recording(t->replay) ? open_recording(t, error) : open_pictures(t, error);
  }
  if (status) {
    return status;
  }
  t->how.response = t->response;
  t->how.progress = show_progress;
  t->how.context = t;
  clt_shots_init(&shots, t->projector, t->camera, 0, 1, 1);
  status = clt_geometry_measure(&shots, &t->how, &t->found.geometry, &t->found.findings, error);
  if (!status) {
    check_epipolar(t);
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
    status = cli_calibration_write(t.folder, &t.found, arguments, &error);
  }
  int code = status ? cli_fail(command, &error) : CLI_DONE;
  clt_geometry_finish(&t.found.geometry);
  if (t.projector != NULL) {
    t.projector->driver->close(t.projector);
    t.camera->driver->close(t.camera);
  }
  return code;
}

const cli_command cli_command_calibrate = {
    .name = "calibrate",
    .synopsis = "--replay DIR [options]",
    .summary = "find where on the panel each camera pixel looks, from recorded frames",
    .options = options,
    .run = run,
    .notes = notes,
};
