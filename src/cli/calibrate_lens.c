/* counterlight calibrate --lens: the camera's lens from photographs of a chessboard. */
#include <stdio.h>
#include <string.h>

#include "base/file.h"
#include "cli/answer.h"
#include "cli/calibrate.h"
#include "cli/folder.h"
#include "device/replay/names.h"
#include "rig/calibration.h"
#include "rig/geometry/lens.h"

typedef struct task {
  int columns, rows; /* inner corners */
  char path[CLT_PATH_MAX];
  clt_calibration *calibration;
  clt_names names;
  int count; /* of photographs */
  clt_image photographs[CLT_CHESSBOARDS_MAX];
  clt_lens lens;
  clt_lens_report report;
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  const char *board = cli_value(command, arguments, "board");
  char folder[CLT_PATH_MAX];
  int end = 0;
  t->columns = 9;
  t->rows = 6;
  if (board != NULL && (sscanf(board, "%dx%d%n", &t->columns, &t->rows, &end) != 2 || board[end] != '\0' ||
                        t->columns < 3 || t->rows < 3 || t->columns > 99 || t->rows > 99)) {
    return clt_fail(error, CLT_BAD_INPUT, "--board: '%s' is no board; give its inner corners, 3 to 99, like 9x6",
                    board);
  }
  static const char *const others[] = {"config", "scene", "replay", "record"};
  for (size_t k = 0; k < sizeof others / sizeof others[0]; k++) {
    if (cli_value(command, arguments, others[k]) != NULL) {
      return clt_fail(error, CLT_BAD_INPUT, "--lens takes photographs; --%s does not go with it", others[k]);
    }
  }
  clt_status status = cli_folder_choose(cli_value(command, arguments, "output"), "calibration", folder, error);
  return status ? status : clt_file_join(folder, "calibration.h5", t->path, error);
}

static clt_status read_photographs(const char *folder, task *t, clt_error *error) {
  clt_curve srgb;
  clt_status status = clt_curve_parse("srgb", &srgb, error);
  status = status ? status : clt_names_find(folder, &t->names, error);
  if (!status && t->names.count > CLT_CHESSBOARDS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %d photographs; at most %d are used, remove the others", folder,
                    t->names.count, CLT_CHESSBOARDS_MAX);
  }
  for (; !status && t->count < t->names.count; t->count++) {
    status = clt_image_read(t->names.path[t->count], &srgb, &t->photographs[t->count], error);
    if (status) {
      return status;
    }
  }
  return status;
}

/* The lens is that of the pixels that were calibrated. */
static clt_status check_size(const task *t, clt_error *error) {
  const clt_calibration_info *info = &t->calibration->info;
  for (int k = 0; k < t->count; k++) {
    const clt_image *photograph = &t->photographs[k];
    if (photograph->width != info->camera_width || photograph->height != info->camera_height) {
      return clt_fail(
          error, CLT_BAD_INPUT, "%s: has %d x %d pixels, the camera of %s %d x %d; photograph the board with it",
          t->names.path[k], photograph->width, photograph->height, t->path, info->camera_width, info->camera_height);
    }
  }
  return CLT_OK;
}

static clt_status keep(task *t, clt_error *error) {
  clt_calibration_info *info = &t->calibration->info;
  const double pinhole[] = {t->lens.fx, t->lens.fy, t->lens.cx, t->lens.cy};
  memcpy(info->lens, pinhole, sizeof pinhole);
  memcpy(info->lens + 4, t->lens.distortion, sizeof t->lens.distortion);
  info->lens_reprojection = t->report.reprojection;
  return clt_calibration_save(t->calibration, t->path, error);
}

static clt_status measure(const char *folder, task *t, clt_error *error) {
  clt_status status = clt_calibration_load(t->path, &t->calibration, error);
  if (status) {
    return clt_fail_within(error, "calibrate the devices first: ");
  }
  status = read_photographs(folder, t, error);
  status = status ? status : check_size(t, error);
  status =
      status ? status : clt_lens_calibrate(t->photographs, t->count, t->columns, t->rows, &t->lens, &t->report, error);
  return status ? status : keep(t, error);
}

bool cli_calibration_lens(const clt_calibration_info *info, clt_lens *lens) {
  const double *l = info->lens;
  *lens = (clt_lens){.fx = l[0], .fy = l[1], .cx = l[2], .cy = l[3]};
  memcpy(lens->distortion, l + 4, sizeof lens->distortion);
  return l[0] > 0;
}

clt_status cli_calibrate_keep_lens(cli_calibrate *t, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_calibration *before = NULL;
  clt_calibration_info *made = &t->found.whole->info;
  clt_lens lens;
  clt_status status = clt_file_join(t->folder, "calibration.h5", path, error);
  if (status || clt_calibration_load(path, &before, NULL)) {
    return status; /* nothing is there that could be kept */
  }
  const clt_calibration_info *info = &before->info;
  if (cli_calibration_lens(info, &lens)) {
    bool same = info->camera_width == made->camera_width && info->camera_height == made->camera_height;
    if (same) {
      memcpy(made->lens, info->lens, sizeof made->lens);
      made->lens_reprojection = info->lens_reprojection;
    }
    clt_findings_add(&t->found.findings, false, "%s",
                     same
                         ? "the lens that was measured before is kept; if the camera, its lens or its focus is another "
                           "one now, measure it again by --lens"
                         : "the lens that was measured before is dropped: the camera's pixels are others; measure it "
                           "again by --lens");
  }
  clt_calibration_destroy(before);
  return CLT_OK;
}

static int answer(const cli_arguments *arguments, const task *t) {
  const clt_lens *lens = &t->lens;
  const double *k = lens->distortion;
  if (arguments->json) {
    return cli_print_json(json_pack("{s:s, s:i, s:i, s:f, s:[f, f], s:[f, f], s:[f, f, f, f, f]}", "output", t->path,
                                    "photographs", t->count, "found", t->report.found, "reprojection",
                                    t->report.reprojection, "focal", lens->fx, lens->fy, "centre", lens->cx, lens->cy,
                                    "distortion", k[0], k[1], k[2], k[3], k[4]));
  }
  if (!arguments->quiet) {
    printf(
        "%s: lens from %d of %d photographs: focal length %.1f x %.1f pixels, centre (%.1f, %.1f), k1 %.4f k2 %.4f p1 "
        "%.5f p2 %.5f k3 %.4f; corners %.2f pixels off\n",
        t->path, t->report.found, t->count, lens->fx, lens->fy, lens->cx, lens->cy, k[0], k[1], k[2], k[3], k[4],
        t->report.reprojection);
  }
  return CLI_DONE;
}

int cli_calibrate_lens(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  clt_status status = read_options(command, arguments, &t, &error);
  status = status ? status : measure(cli_value(command, arguments, "lens"), &t, &error);
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  for (int k = 0; k < t.count; k++) {
    clt_image_finish(&t.photographs[k]);
  }
  clt_names_finish(&t.names);
  clt_calibration_destroy(t.calibration);
  return code;
}
