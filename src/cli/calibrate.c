/* counterlight calibrate: what a rig must know of its projector and its camera, from the devices or from a replay. */
#include "cli/calibrate.h"

#include "base/file.h"
#include "cli/answer.h"
#include "cli/folder.h"
#include "counterlight/replay.h"

static const cli_option options[] = {
    {"config", 'c', "C", "configuration that names the devices to calibrate"},
    {"scene", 's', "S", "scene file: calibrate simulated devices"},
    {"record", 0, "DIR", "keep every frame there, to be calibrated from again"},
    {"replay", 0, "DIR", "a recording, a folder of pictures, or a list of them"},
    {"output", 'o', "DIR", "where the results go (default calibration)"},
    {"levels", 0, "N", "of the projector's ramps, 17..65 (default 33)"},
    {"frames", 0, "N", "averaged for each field, 2..64 (default 6; noise needs two)"},
    {"watch", 0, "X", "seconds to watch the camera for automatic controls (default 20; 0: not at all)"},
    {"reference", 0, "FILE", "calibration (OpenCV's YAML) to check against"},
    {"panel", 0, "WxH", "pictures: the panel's pixels (default 1280x720)"},
    {"response", 0, "CURVE", "pictures: the camera's: linear, srgb or gamma:G (default srgb)"},
    {"exposure-ms", 0, "X", "recorded pictures alone: exposure time of the frames to take (default: the longest)"},
    {"lens", 0, "DIR", "photographs of a chessboard: put the camera's lens into the calibration of --output"},
    {"board", 0, "CxR", "inner corners of that chessboard (default 9x6, as charts/chessboard-a4.svg)"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Measures latency and jitter, the responses of projector and camera, crosstalk, black, noise, the exposures to\n"
    "take, and by structured light the panel coordinate that each camera pixel sees. calibration.h5 holds it all for\n"
    "rigs that are opened later, report.html shows it, summary.json has the numbers. A recording of a whole\n"
    "calibration is calibrated from in the same way, with the same --levels, --frames and --watch.\n"
    "What is wrong and what to do is printed line by line: WRONG where measurements are wrong until it is put right.\n"
    "\n"
    "Of pictures only the geometry is found: Gray code with inverses, columns from the coarsest bit, then rows.\n"
    "map.npy holds x, y and confidence, float32 [3, height, width], NaN where masked: panel pixel k spans [k, k + 1).\n"
    "coverage.png shows decoded pixels by their place on the panel, and masked ones by cause: black unlit, white\n"
    "saturated, blue ambiguous, magenta outside the panel, yellow isolated, cyan lit from two places.\n"
    "Distances are those of camera pixels from the epipolar lines of --reference, or without one of the map's own\n"
    "fundamental matrix. A lens that the calibration in --output has is kept, and straightened for them.\n";

static clt_status read_panel(const char *text, cli_calibrate *t, clt_error *error) {
  int end = 0;
  if (sscanf(text, "%dx%d%n", &t->panel_width, &t->panel_height, &end) != 2 || text[end] != '\0') {
    return clt_fail(error, CLT_BAD_INPUT, "--panel: '%s' is no size; give it like 1280x720", text);
  }
  return CLT_OK;
}

/* What --replay of pictures needs. */
static clt_status read_pictures(const cli_command *command, const cli_arguments *arguments, cli_calibrate *t,
                                clt_error *error) {
  const char *panel = cli_value(command, arguments, "panel"), *curve = cli_value(command, arguments, "response");
  double exposure_ms = 0;
  clt_status status = CLT_OK;
  t->panel_width = 1280;
  t->panel_height = 720;
  if (panel != NULL) {
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
  return status;
}

static clt_status read_measure(const cli_command *command, const cli_arguments *arguments, cli_calibrate *t,
                               clt_error *error) {
  const char *watch = cli_value(command, arguments, "watch");
  clt_status status = cli_integer(command, arguments, "levels", 17, 65, &t->options.levels, error);
  if (!status) {
    status = cli_integer(command, arguments, "frames", 2, 64, &t->options.frames, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "watch", 0, 600, &t->options.watch_s, error);
  }
  if (!status && watch != NULL && t->options.watch_s == 0) {
    t->options.watch_s = -1;
  }
  return status;
}

/* One source of frames: a configuration, a scene or a replay. */
static clt_status read_source(const cli_command *command, const cli_arguments *arguments, cli_calibrate *t,
                              clt_error *error) {
  const char *config = cli_value(command, arguments, "config"), *scene = cli_value(command, arguments, "scene");
  t->replay = cli_value(command, arguments, "replay");
  t->record = cli_value(command, arguments, "record");
  if ((config != NULL) + (scene != NULL) + (t->replay != NULL) != 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "give one of --config, --scene and --replay; usage: counterlight calibrate %s", command->synopsis);
  }
  if (t->replay != NULL) {
    return t->record == NULL ? CLT_OK
                             : clt_fail(error, CLT_BAD_INPUT,
                                        "--record: what is replayed is recorded already; copy %s instead", t->replay);
  }
  return config ? clt_station_read(config, &t->config, error) : clt_station_for_scene(scene, &t->config, error);
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, cli_calibrate *t,
                               clt_error *error) {
  clt_status status = read_source(command, arguments, t, error);
  t->reference = cli_value(command, arguments, "reference");
  if (!status) {
    status = read_measure(command, arguments, t, error);
  }
  if (!status) {
    status = read_pictures(command, arguments, t, error);
  }
  return status ? status : cli_folder_choose(cli_value(command, arguments, "output"), "calibration", t->folder, error);
}

/* A map that cannot be checked is still a map. */
static void check_epipolar(cli_calibrate *t) {
  clt_error error = {0};
  if (t->found.geometry.decode.count[CLT_PIXEL_DECODED] == 0) {
    return; /* findings say so */
  }
  cli_progress_note(&t->progress, "epipolar distances");
  clt_lens lens;
  bool known = t->found.whole != NULL && cli_calibration_lens(&t->found.whole->info, &lens);
  if (clt_epipolar_check(&t->found.geometry.map, t->reference != NULL ? &t->stereo : NULL, known ? &lens : NULL,
                         &t->found.epipolar, &error)) {
    clt_findings_add(&t->found.findings, false, "the map was not checked: %s", error.message);
  }
}

/* A whole calibration begins with a white panel, structured light with stripes. */
static clt_status begins_white(const char *folder, bool *white, clt_error *error) {
  clt_projector *projector = NULL;
  clt_camera *camera = NULL;
  clt_projector_info panel;
  clt_status status = clt_replay_open(folder, &projector, &camera, error);
  if (status) {
    return status;
  }
  projector->driver->describe(projector, &panel);
  clt_image picture = {0};
  status = clt_image_init(&picture, panel.channels, panel.height, panel.width, error);
  for (size_t k = 0; !status && k < (size_t)panel.channels * (size_t)panel.height * (size_t)panel.width; k++) {
    picture.data[k] = 1;
  }
  int64_t shown_ns = 0;
  *white = !status && projector->driver->present(projector, picture.data, &shown_ns, NULL) == CLT_OK;
  clt_image_finish(&picture);
  projector->driver->close(projector);
  camera->driver->close(camera);
  return status;
}

static clt_status measure(cli_calibrate *t, clt_error *error) {
  bool whole = t->replay == NULL;
  clt_status status = t->reference != NULL ? clt_stereo_read(t->reference, &t->stereo, error) : CLT_OK;
  if (!status && t->replay != NULL && clt_replay_is_recording(t->replay)) {
    status = begins_white(t->replay, &whole, error);
  }
  if (!status) {
    status = whole ? cli_calibrate_whole(t, error) : cli_calibrate_geometry(t, error);
  }
  if (!status && t->found.whole != NULL) {
    status = cli_calibrate_keep_lens(t, error);
  }
  if (!status) {
    check_epipolar(t);
  }
  return status;
}

static void close_all(cli_calibrate *t) {
  if (t->found.whole != NULL) {
    clt_calibration_destroy(t->found.whole);
  } else {
    clt_geometry_finish(&t->found.geometry);
  }
  if (t->projector != NULL) {
    t->projector->driver->close(t->projector);
    t->camera->driver->close(t->camera);
  }
  clt_station_close(&t->station);
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  cli_calibrate t = {0};
  clt_error error = {0};
  if (cli_value(command, arguments, "lens") != NULL) {
    return cli_calibrate_lens(command, arguments);
  }
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
  close_all(&t);
  return code;
}

const cli_command cli_command_calibrate = {
    .name = "calibrate",
    .synopsis = "--config C | --scene S | --replay DIR | --lens DIR [-o DIR] [options]",
    .summary = "measure what a rig must know of its projector and camera, and say what is wrong",
    .options = options,
    .run = run,
    .notes = notes,
};
