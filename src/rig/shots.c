#include "rig/shots.h"

#include <math.h>
#include <string.h>

#include "base/random.h"

/* Frames under way when the exposure time is changed keep the old one; more than these is no delay but a refusal. */
enum { FRAMES_MAX = 8 };
#define EXPOSURE_TOLERANCE 0.01
/* A camera rounds to its unit of time, and takes one unit at least; what it really took is the frame's exposure_s. */
#define EXPOSURE_ROUNDING 0.5
/* Read noise in code values from which no two frames with so many samples off the ends of the scale are equal. */
#define NOISY 0.2
enum { TELLING_SAMPLES = 100 };

void clt_shots_init(clt_shots *shots, clt_projector *projector, clt_camera *camera, double latency_s, double timeout_s,
                    int attempts) {
  *shots = (clt_shots){
      .projector = projector, .camera = camera, .latency_s = latency_s, .timeout_s = timeout_s, .attempts = attempts};
  projector->driver->describe(projector, &shots->panel);
  camera->driver->describe(camera, &shots->sensor);
  clt_shots_calibrate(shots, shots->sensor.black_level, shots->sensor.full_well, shots->sensor.read_noise);
}

void clt_shots_calibrate(clt_shots *shots, double black_level, double full_well, double read_noise) {
  clt_camera_info *sensor = &shots->sensor;
  sensor->black_level = black_level;
  sensor->full_well = full_well;
  sensor->read_noise = read_noise;
  shots->noisy = read_noise * ((1 << sensor->bits) - 1 - black_level) / full_well >= NOISY;
}

clt_status clt_shots_show(clt_shots *shots, const float *codes, int64_t *complete_ns, clt_error *error) {
  int64_t shown_ns = 0;
  clt_status status = shots->projector->driver->present(shots->projector, codes, &shown_ns, error);
  if (status == CLT_OK) {
    shots->shown++;
    *complete_ns = shown_ns + (int64_t)ceil(shots->latency_s * 1e9);
  }
  return status;
}

static clt_status check_frame(const clt_shots *shots, const clt_frame *frame, clt_error *error) {
  const clt_camera_info *sensor = &shots->sensor;
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

/* Whether enough samples can carry noise. */
static bool tells(const clt_frame *frame) {
  size_t samples = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels, telling = 0;
  uint16_t full = (uint16_t)((1 << frame->bits) - 1);
  for (size_t k = 0; k < samples && telling < TELLING_SAMPLES; k++) {
    telling += frame->samples[k] > 0 && frame->samples[k] < full;
  }
  return telling == TELLING_SAMPLES;
}

uint64_t clt_shots_digest(const clt_frame *frame) {
  if (!tells(frame)) {
    return 0;
  }
  size_t bytes = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels * sizeof *frame->samples;
  uint64_t digest = 1, word;
  for (size_t at = 0; at < bytes; at += sizeof word) {
    word = 0;
    memcpy(&word, (const char *)frame->samples + at, bytes - at < sizeof word ? bytes - at : sizeof word);
    digest = clt_random_scramble(digest + word);
  }
  return digest != 0 ? digest : 1;
}

/* True where the frame repeats the one before, which it then counts. */
static bool repeats(clt_shots *shots, const clt_frame *frame) {
  uint64_t before = shots->digest;
  shots->digest = shots->noisy ? clt_shots_digest(frame) : 0;
  bool again = shots->digest != 0 && shots->digest == before;
  shots->stuck += again;
  return again;
}

/* One attempt at a frame that begins at or after not_before. */
static clt_status try_take(clt_shots *shots, int64_t not_before, double seconds, clt_frame *frame, clt_error *error) {
  clt_camera *camera = shots->camera;
  double allowed = EXPOSURE_TOLERANCE * seconds + EXPOSURE_ROUNDING * shots->sensor.exposure_min_s;
  bool settled = true, stuck = false;
  clt_status status = camera->driver->set_exposure(camera, seconds, error);
  for (int taken = 0; status == CLT_OK && taken < FRAMES_MAX; taken++) {
    status = camera->driver->next(camera, not_before, shots->timeout_s, frame, error);
    status = status == CLT_OK ? check_frame(shots, frame, error) : status;
    if (status != CLT_OK) {
      return status;
    }
    settled = fabs(frame->exposure_s - seconds) <= allowed;
    stuck = repeats(shots, frame);
    if (settled && !stuck && frame->exposed_ns >= not_before) {
      return CLT_OK;
    }
    shots->retaken += stuck;
    not_before = frame->exposed_ns >= not_before ? frame->exposed_ns + 1 : not_before;
  }
  if (status != CLT_OK) {
    return status;
  }
  if (settled && stuck) {
    return clt_fail(error, CLT_TIMEOUT,
                    "the camera sends the same samples again and again (%ld times so far, the last as frame %u); "
                    "check its connection",
                    shots->stuck, frame->sequence);
  }
  return clt_fail(error, CLT_TIMEOUT,
                  "no frame with exposure %.4g ms after %d frames (last had %.4g ms); check the camera's exposure "
                  "control",
                  seconds * 1e3, FRAMES_MAX, frame->exposure_s * 1e3);
}

clt_status clt_shots_take(clt_shots *shots, int64_t not_before_ns, double exposure_s, clt_frame *frame,
                          clt_error *error) {
  clt_status status = CLT_TIMEOUT;
  *frame = (clt_frame){0};
  for (int attempt = 0; attempt < shots->attempts && status == CLT_TIMEOUT; attempt++) {
    status = try_take(shots, not_before_ns, exposure_s, frame, error);
  }
  if (status == CLT_TIMEOUT) {
    return clt_fail_within(error, "pattern %ld, exposure %.4g ms, %d attempts: ", shots->shown, exposure_s * 1e3,
                           shots->attempts);
  }
  shots->frames += status == CLT_OK;
  shots->last_ns = status == CLT_OK ? frame->exposed_ns : shots->last_ns;
  return status;
}
