#include "cli/photograph.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "rig/merge.h"

static clt_status show(const clt_station *station, const clt_rig_config *rig, const clt_image *drive,
                       int64_t *complete_ns, clt_error *error) {
  size_t values = clt_image_size(drive);
  float *codes = clt_alloc(values, sizeof *codes);
  if (codes == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a panel of %d x %d pixels", drive->width, drive->height);
  }
  for (size_t k = 0; k < values; k++) {
    codes[k] = (float)clt_curve_encode(&rig->projector, drive->data[k]);
  }
  clt_status status = station->projector->driver->present(station->projector, codes, complete_ns, error);
  *complete_ns += (int64_t)ceil(rig->latency_s * 1e9);
  free(codes);
  return status;
}

/* The first frame of an exposure time; frames under way keep the one before. */
static clt_status take(const clt_station *station, const clt_rig_config *rig, int64_t not_before, int exposure,
                       clt_merge *merge, clt_error *error) {
  enum { FRAMES_MAX = 16 };
  clt_camera *camera = station->camera;
  double seconds = rig->exposures_s[exposure];
  clt_status status = camera->driver->set_exposure(camera, seconds, error);
  for (int taken = 0; taken < FRAMES_MAX && status == CLT_OK; taken++) {
    clt_frame frame;
    status = camera->driver->next(camera, not_before, rig->timeout_s, &frame, error);
    if (status == CLT_OK && fabs(frame.exposure_s - seconds) <= 0.01 * seconds) {
      clt_merge_add(merge, exposure, &frame);
      return CLT_OK;
    }
  }
  return status != CLT_OK ? status
                          : clt_fail(error, CLT_TIMEOUT, "no frame with exposure %.4g ms after %d frames",
                                     seconds * 1e3, FRAMES_MAX);
}

static clt_status take_all(const clt_station *station, const clt_rig_config *rig, const clt_image *drive,
                           clt_merge *merge, clt_image *seen, clt_error *error) {
  clt_image deviation = {0};
  int64_t complete_ns = 0;
  clt_status status = show(station, rig, drive, &complete_ns, error);
  for (int k = 0; k < rig->exposure_count && status == CLT_OK; k++) {
    status = take(station, rig, complete_ns, k, merge, error);
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
  clt_camera_info sensor;
  clt_footprints pixels = {0}; /* of cells that are the pixels themselves */
  clt_merge merge = {0};
  station->camera->driver->describe(station->camera, &sensor);
  clt_status status = clt_footprints_align(sensor.width, sensor.height, sensor.width, sensor.height, &pixels, error);
  if (status == CLT_OK) {
    status = clt_merge_init(&merge, &sensor, &rig->camera, &pixels, rig->exposure_count, error);
  }
  if (status == CLT_OK) {
    status = take_all(station, rig, drive, &merge, seen, error);
  }
  clt_merge_finish(&merge);
  clt_footprints_finish(&pixels);
  return status;
}
