/* One observation: pattern out, frames in. Frames are paired with the pattern by time stamps alone: the first frame
 * whose exposure began after the pattern's light was complete, and that had the exposure time asked for. */
#include <math.h>
#include <stdbool.h>

#include "rig/internal.h"

/* Frames under way when the exposure time is changed keep the old one; more than these is no delay but a refusal. */
enum { FRAMES_MAX = 8 };
#define EXPOSURE_TOLERANCE 0.01

/* Replicates the cells over the panel's pixels, encoded by the projector's response. */
static void encode_drive(clt_camera_rig *rig, const clt_image *drive) {
  int kx = rig->panel.width / drive->width, ky = rig->panel.height / drive->height;
  for (int line = 0; line < drive->channels * drive->height; line++) {
    const float *cells = drive->data + (size_t)line * (size_t)drive->width;
    float *codes = rig->codes + (size_t)line * (size_t)ky * (size_t)rig->panel.width;
    for (int x = 0; x < rig->panel.width; x += kx) {
      float code = (float)clt_curve_encode(&rig->config.projector, cells[x / kx]);
      for (int y = 0; y < ky; y++) {
        for (int within = 0; within < kx; within++) {
          codes[(size_t)y * (size_t)rig->panel.width + (size_t)(x + within)] = code;
        }
      }
    }
  }
}

static clt_status check_frame(const clt_camera_rig *rig, const clt_frame *frame, clt_error *error) {
  const clt_camera_info *sensor = &rig->sensor;
  if (frame->width != sensor->width || frame->height != sensor->height || frame->channels != sensor->channels ||
      frame->bits != sensor->bits) {
    return clt_fail(error, CLT_FAILED,
                    "the camera sent a frame of %d x %d pixels, %d channels, %d bits but had announced %d x %d, %d, "
                    "%d; open it again",
                    frame->width, frame->height, frame->channels, frame->bits, sensor->width, sensor->height,
                    sensor->channels, sensor->bits);
  }
  return CLT_OK;
}

/* One attempt at the frame of one exposure, begun at or after not_before. */
static clt_status try_exposure(clt_camera_rig *rig, int64_t not_before, double seconds, clt_frame *frame,
                               clt_error *error) {
  clt_camera *camera = rig->camera;
  clt_status status = camera->driver->set_exposure(camera, seconds, error);
  for (int taken = 0; status == CLT_OK && taken < FRAMES_MAX; taken++) {
    status = camera->driver->next(camera, not_before, rig->config.timeout_s, frame, error);
    if (status != CLT_OK) {
      break;
    }
    status = check_frame(rig, frame, error);
    bool settled = fabs(frame->exposure_s - seconds) <= EXPOSURE_TOLERANCE * seconds;
    if (status == CLT_OK && settled && frame->exposed_ns >= not_before) {
      return CLT_OK;
    }
    not_before = frame->exposed_ns >= not_before ? frame->exposed_ns + 1 : not_before;
  }
  if (status != CLT_OK) {
    return status;
  }
  return clt_fail(error, CLT_TIMEOUT,
                  "no frame with exposure %.4g ms after %d frames (last had %.4g ms); check the camera's exposure "
                  "control",
                  seconds * 1e3, FRAMES_MAX, frame->exposure_s * 1e3);
}

static clt_status take_exposure(clt_camera_rig *rig, int64_t not_before, int exposure, clt_error *error) {
  double seconds = rig->config.exposures_s[exposure];
  clt_frame frame = {0};
  clt_status status = CLT_TIMEOUT;
  for (int attempt = 0; attempt < rig->config.attempts && status == CLT_TIMEOUT; attempt++) {
    status = try_exposure(rig, not_before, seconds, &frame, error);
  }
  if (status == CLT_TIMEOUT) {
    return clt_fail_within(error, "pattern %ld, exposure %.4g ms, %d attempts: ", rig->patterns, seconds * 1e3,
                           rig->config.attempts);
  }
  if (status == CLT_OK) {
    clt_merge_add(&rig->merge, exposure, &frame);
    rig->frames++;
  }
  return status;
}

static clt_status check_image(const clt_camera_rig *rig, const clt_image *image, const char *what, clt_error *error) {
  const clt_rig_config *config = &rig->config;
  if (image->width == config->width && image->height == config->height && image->channels == rig->sensor.channels) {
    return CLT_OK;
  }
  return clt_fail(error, CLT_BAD_INPUT, "the %s is %d x %d with %d channels, the rig's grid %d x %d with %d", what,
                  image->width, image->height, image->channels, config->width, config->height, rig->sensor.channels);
}

clt_status clt_camera_rig_observe(clt_rig *base, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                                  clt_error *error) {
  clt_camera_rig *rig = (clt_camera_rig *)base;
  clt_status status = check_image(rig, drive, "drive", error);
  if (status == CLT_OK) {
    status = check_image(rig, radiance, "radiance", error);
  }
  if (status == CLT_OK) {
    status = check_image(rig, deviation, "deviation", error);
  }
  if (status != CLT_OK) {
    return status;
  }
  encode_drive(rig, drive);
  int64_t shown = 0;
  status = rig->projector->driver->present(rig->projector, rig->codes, &shown, error);
  if (status != CLT_OK) {
    return status;
  }
  rig->patterns++;
  int64_t complete = shown + (int64_t)ceil(rig->config.latency_s * 1e9);
  for (int k = 0; k < rig->config.exposure_count && status == CLT_OK; k++) {
    status = take_exposure(rig, complete, k, error);
  }
  if (status == CLT_OK) {
    clt_merge_radiance(&rig->merge, radiance, deviation);
  }
  return status;
}
