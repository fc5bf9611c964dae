#include "cli/photograph.h"

#include <stdlib.h>

#include "base/memory.h"
#include "rig/merge.h"
#include "rig/shots.h"

static clt_status show(clt_shots *shots, const clt_panel *panel, const clt_image *drive, int64_t *complete_ns,
                       clt_error *error) {
  float *codes = clt_alloc(clt_image_size(drive), sizeof *codes);
  if (codes == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a panel of %d x %d pixels", drive->width, drive->height);
  }
  clt_panel_encode(panel, drive, drive->channels, drive->height, drive->width, codes);
  clt_status status = clt_shots_show(shots, codes, complete_ns, error);
  free(codes);
  return status;
}

static clt_status take_all(clt_shots *shots, const clt_rig_config *rig, const clt_image *drive, clt_merge *merge,
                           clt_image *seen, clt_error *error) {
  clt_image deviation = {0};
  int64_t complete_ns = 0;
  clt_status status = show(shots, &rig->projector, drive, &complete_ns, error);
  for (int k = 0; k < rig->exposure_count && status == CLT_OK; k++) {
    clt_frame frame;
    status = clt_shots_take(shots, complete_ns, rig->exposures_s[k], &frame, error);
    if (status == CLT_OK) {
      clt_merge_add(merge, k, &frame);
    }
  }
  if (status == CLT_OK) {
    status = clt_image_init(seen, merge->camera.channels, merge->camera.height, merge->camera.width, error);
  }
  if (status == CLT_OK) {
    status = clt_image_init(&deviation, seen->channels, seen->height, seen->width, error);
  }
  if (status == CLT_OK) {
    clt_merge_radiance(merge, seen, &deviation);
  }
  clt_image_finish(&deviation);
  return status;
}

clt_status cli_photograph(const clt_station *station, const clt_rig_config *rig, const clt_image *drive,
                          clt_image *seen, clt_error *error) {
  clt_shots shots;
  clt_footprints pixels = {0}; /* of cells that are the pixels themselves */
  clt_merge merge = {0};
  clt_shots_init(&shots, station->projector, station->camera, rig->latency_s, rig->timeout_s, rig->attempts);
  const clt_camera_info sensor = shots.sensor;
  clt_status status = clt_footprints_align(sensor.width, sensor.height, sensor.width, sensor.height, &pixels, error);
  if (status == CLT_OK) {
    status = clt_merge_init(&merge, &sensor, &rig->camera, &pixels, rig->exposure_count, error);
  }
  if (status == CLT_OK) {
    status = take_all(&shots, rig, drive, &merge, seen, error);
  }
  clt_merge_finish(&merge);
  clt_footprints_finish(&pixels);
  return status;
}
