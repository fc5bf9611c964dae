/* One observation: picture out, frames in. clt_shots_take pairs them by time stamps; what a frame shows proves the pair
 * where the configuration asks for it: the patch by its number, and exposures of one picture by their agreement. */
#include <math.h>
#include <stdbool.h>

#include "rig/internal.h"
#include "rig/timing/patch.h"

/* The share of cells that may contradict themselves at every attempt, as defective pixels do, before all is refused. */
#define DOUBTFUL_SHARE 0.005

/* Whether a frame may be of the picture that is shown; counts one that is not. */
static bool shows_picture(clt_camera_rig *rig, const clt_frame *frame) {
  const clt_patch *patch = &rig->config.patch;
  if (patch->side == 0) {
    return true;
  }
  clt_patch_reading reading =
      clt_patch_read(patch, rig->config.width, &rig->footprints, frame, rig->shots.sensor.black_level);
  bool shown = reading.saturated || (reading.legible && reading.id == rig->shots.shown % CLT_PATCH_IDS);
  rig->strange += !shown;
  return shown;
}

/* Every frame that was refused, for messages. */
static clt_status fail_with_numbers(const clt_camera_rig *rig, const char *what, clt_error *error) {
  const clt_shots *shots = &rig->shots;
  return clt_fail(error, CLT_TIMEOUT,
                  "picture %ld: %s; of %ld frames so far %ld repeated the one before, %ld were of another picture and "
                  "%ld contradicted the others: check the camera's connection, and the latency of %.4g ms",
                  shots->shown, what, shots->frames + shots->stuck, shots->stuck, rig->strange, rig->torn,
                  shots->latency_s * 1e3);
}

static clt_status take_exposure(clt_camera_rig *rig, int64_t not_before, int exposure, clt_error *error) {
  double seconds = rig->config.exposures_s[exposure];
  for (int attempt = 0; attempt < rig->config.attempts; attempt++) {
    clt_frame frame;
    clt_status status = clt_shots_take(&rig->shots, not_before, seconds, &frame, error);
    if (status != CLT_OK) {
      return status;
    }
    if (shows_picture(rig, &frame)) {
      clt_merge_add(&rig->merge, exposure, &frame);
      return CLT_OK;
    }
    rig->shots.frames--;
    rig->shots.retaken++;
    not_before = frame.exposed_ns + 1;
  }
  return fail_with_numbers(rig, "no frame shows its patch", error);
}

/* Compares the exposures, and takes again those that contradict the others. What a few values say against each other at
 * every attempt is the fault of their pixels: they stay doubtful. */
static clt_status verify(clt_camera_rig *rig, int64_t not_before, clt_error *error) {
  int exposures = rig->config.exposure_count;
  size_t allowed = (size_t)(DOUBTFUL_SHARE * (double)rig->footprints.cells);
  bool bad[CLT_EXPOSURES_MAX];
  size_t apart = clt_agreement_check(&rig->agreement, &rig->merge, bad);
  rig->doubted += apart > allowed;
  for (int round = 0; round < 2 * rig->config.attempts && apart > 0; round++) {
    for (int k = 0; k < exposures; k++) {
      clt_status status = bad[k] ? take_exposure(rig, not_before, k, error) : CLT_OK;
      if (status != CLT_OK) {
        return status;
      }
      rig->torn += bad[k];
      rig->shots.retaken += bad[k];
      rig->shots.frames -= bad[k];
    }
    apart = clt_agreement_check(&rig->agreement, &rig->merge, bad);
  }
  return apart <= allowed ? CLT_OK : fail_with_numbers(rig, "its exposures contradict each other", error);
}

/* No value where the patch is, nor where exposures contradict each other. */
static void leave_out(const clt_camera_rig *rig, clt_image *deviation) {
  size_t cells = rig->footprints.cells, values = cells * (size_t)deviation->channels;
  for (size_t k = 0; k < values; k++) {
    int x = (int)(k % cells) % rig->config.width, y = (int)(k % cells) / rig->config.width;
    bool doubtful = rig->agreement.doubtful != NULL && rig->agreement.doubtful[k];
    if (doubtful || clt_patch_covers(&rig->config.patch, x, y)) {
      deviation->data[k] = INFINITY;
    }
  }
}

static clt_status check_image(const clt_camera_rig *rig, const clt_image *image, const char *what, clt_error *error) {
  const clt_rig_config *config = &rig->config;
  int channels = rig->shots.sensor.channels;
  if (image->width == config->width && image->height == config->height && image->channels == channels) {
    return CLT_OK;
  }
  return clt_fail(error, CLT_BAD_INPUT, "the %s is %d x %d with %d channels, the rig's grid %d x %d with %d", what,
                  image->width, image->height, image->channels, config->width, config->height, channels);
}

/* Shows the drive, with the number that the picture will have in its patch. */
static clt_status show_drive(clt_camera_rig *rig, const clt_image *drive, int64_t *complete, clt_error *error) {
  const clt_projector_info *panel = &rig->shots.panel;
  clt_panel_encode(&rig->config.projector, drive, panel->channels, panel->height, panel->width, rig->codes);
  clt_patch_write(&rig->config.patch, rig->config.width, rig->config.height, panel, rig->shots.shown + 1, rig->codes);
  return clt_shots_show(&rig->shots, rig->codes, complete, error);
}

clt_status clt_camera_rig_observe(clt_rig *base, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                                  clt_error *error) {
  clt_camera_rig *rig = (clt_camera_rig *)base;
  int64_t complete = 0;
  clt_status status = check_image(rig, drive, "drive", error);
  if (status == CLT_OK) {
    status = check_image(rig, radiance, "radiance", error);
  }
  if (status == CLT_OK) {
    status = check_image(rig, deviation, "deviation", error);
  }
  if (status == CLT_OK) {
    status = show_drive(rig, drive, &complete, error);
  }
  for (int k = 0; k < rig->config.exposure_count && status == CLT_OK; k++) {
    status = take_exposure(rig, complete, k, error);
  }
  if (status == CLT_OK && rig->agreement.rate != NULL) {
    status = verify(rig, complete, error);
  }
  if (status == CLT_OK) {
    clt_merge_radiance(&rig->merge, radiance, deviation);
    leave_out(rig, deviation);
  }
  return status;
}
