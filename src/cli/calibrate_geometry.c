/* calibrate on pictures: the geometry alone. */
#include "cli/calibrate.h"
#include "counterlight/replay.h"

#define ANY_EXPOSURE_S 0.01 /* pictures have whatever is asked for */

static bool show_progress(void *context, int done, int total) {
  cli_calibrate *t = context;
  return cli_progress_count(&t->progress, "structured light", done, total);
}

static clt_status open_recording(cli_calibrate *t, clt_geometry_options *how, clt_error *error) {
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
  how->exposure_s = t->exposure_s > 0 ? t->exposure_s : longest_s;
  return clt_gray_init(&how->gray, panel.width, panel.height, error);
}

static clt_status open_pictures(cli_calibrate *t, clt_geometry_options *how, clt_error *error) {
  int pictures = 0;
  clt_status status =
      clt_replay_open_pictures(t->replay, t->panel_width, t->panel_height, &t->projector, &t->camera, &pictures, error);
  how->exposure_s = t->exposure_s > 0 ? t->exposure_s : ANY_EXPOSURE_S;
  t->response = t->response_given ? t->response : (clt_curve){.kind = CLT_CURVE_SRGB};
  return status ? status : clt_gray_init_counted(&how->gray, t->panel_width, t->panel_height, pictures, error);
}

clt_status cli_calibrate_geometry(cli_calibrate *t, clt_error *error) {
  clt_shots shots;
  clt_geometry_options how = {.progress = show_progress, .context = t};
  clt_status status =
      clt_replay_is_recording(t->replay) ? open_recording(t, &how, error) : open_pictures(t, &how, error);
  if (status) {
    return status;
  }
  how.response = t->response;
  clt_shots_init(&shots, t->projector, t->camera, 0, 1, 1);
  show_progress(t, 0, 0);
  return clt_geometry_measure(&shots, &how, &t->found.geometry, &t->found.findings, error);
}
