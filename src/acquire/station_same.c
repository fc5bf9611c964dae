/* Whether two configurations say the same. Field by field: what lies between the fields of a structure may differ. */
#include <string.h>

#include "counterlight/station.h"

/* A file names its curves; a measured one never comes from it. */
static bool same_curve(const clt_curve *a, const clt_curve *b) {
  return a->kind == b->kind && (a->kind != CLT_CURVE_GAMMA || a->gamma == b->gamma);
}

static bool same_projector(const clt_projector_config *a, const clt_projector_config *b) {
  return strcmp(a->driver, b->driver) == 0 && strcmp(a->monitor, b->monitor) == 0 && a->width == b->width &&
         a->height == b->height && a->refresh_hz == b->refresh_hz && a->window == b->window;
}

static bool same_camera(const clt_camera_config *a, const clt_camera_config *b) {
  return strcmp(a->driver, b->driver) == 0 && strcmp(a->device, b->device) == 0 && strcmp(a->format, b->format) == 0 &&
         a->width == b->width && a->height == b->height && a->rate_hz == b->rate_hz && a->gain == b->gain &&
         a->white_balance_k == b->white_balance_k && a->focus == b->focus && a->power_line_hz == b->power_line_hz;
}

static bool same_rig(const clt_rig_config *a, const clt_rig_config *b) {
  bool same = a->width == b->width && a->height == b->height && a->exposure_count == b->exposure_count &&
              a->latency_s == b->latency_s && a->timeout_s == b->timeout_s && a->attempts == b->attempts &&
              a->verify == b->verify && a->patch.left == b->patch.left && a->patch.top == b->patch.top &&
              a->patch.side == b->patch.side && same_curve(&a->camera, &b->camera);
  for (int k = 0; same && k < a->exposure_count; k++) {
    same = a->exposures_s[k] == b->exposures_s[k];
  }
  for (int c = 0; same && c < CLT_PANEL_CHANNELS; c++) {
    same = same_curve(&a->projector.response[c], &b->projector.response[c]);
  }
  return same;
}

static bool same_acquire(const clt_acquire_options *a, const clt_acquire_options *b) {
  return a->threshold == b->threshold && a->error == b->error && a->seconds == b->seconds && a->repeats == b->repeats &&
         a->checks == b->checks && a->seed == b->seed && a->watch == b->watch && a->watch_s == b->watch_s &&
         a->patience_s == b->patience_s;
}

bool clt_station_same(const clt_station_config *a, const clt_station_config *b) {
  return strcmp(a->scene, b->scene) == 0 && strcmp(a->calibration, b->calibration) == 0 &&
         strcmp(a->replay, b->replay) == 0 && strcmp(a->record, b->record) == 0 && strcmp(a->scheme, b->scheme) == 0 &&
         a->projector_response_given == b->projector_response_given &&
         a->camera_response_given == b->camera_response_given && a->verify_given == b->verify_given &&
         same_projector(&a->projector, &b->projector) && same_camera(&a->camera, &b->camera) &&
         same_rig(&a->rig, &b->rig) && same_acquire(&a->acquire, &b->acquire);
}
