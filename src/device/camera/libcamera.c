#include "device/camera/libcamera.h"

#include <math.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "device/camera/libcamera_shim.h"
#include "device/camera/pixels.h"

/* Without a word from the camera, pictures that were being exposed when the settings went out, and those that the
 * camera takes to follow: from the one after these on the settings hold. */
enum { SETTLING = 3 };
/* For the first pictures. */
enum { FIRST_MOST = 40, INTERVALS = 5 };
#define FIRST_S 8.0
#define EXPOSURE_TOLERANCE 0.01
#define EXPOSURE_ROUNDING_S 5e-5 /* a sensor's rows */
/* Until a calibration has measured it. */
#define FULL_WELL 1e4
#define READ_NOISE_CODES 0.15

typedef struct libcamera_camera {
  clt_camera base;
  clt_libcamera *stream;
  clt_libcamera_stream agreed;
  clt_picture_layout layout;
  const clt_pixel_format *format;
  uint16_t *samples;
  clt_camera_info info;
  double exposure_s; /* asked for */
  uint32_t revision; /* of the settings that ask for it */
  int settled;       /* pictures of that revision so far */
} libcamera_camera;

static void describe(const clt_camera *camera, clt_camera_info *info) {
  *info = ((const libcamera_camera *)camera)->info;
}

static double round_exposure(const libcamera_camera *self, double seconds) {
  double step = self->agreed.exposure_step_s;
  return step > 0 ? fmax(round(seconds / step), 1) * step : round(seconds * 1e6) / 1e6;
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  libcamera_camera *self = (libcamera_camera *)camera;
  const clt_camera_info *info = &self->info;
  if (!(seconds >= info->exposure_min_s * (1 - EXPOSURE_TOLERANCE) &&
        seconds <= info->exposure_max_s * (1 + EXPOSURE_TOLERANCE))) {
    return clt_fail(error, CLT_BAD_INPUT, "camera \"%s\" exposes for %.4g to %.4g ms, not for %.4g", self->agreed.id,
                    info->exposure_min_s * 1e3, info->exposure_max_s * 1e3, seconds * 1e3);
  }
  double rounded = round_exposure(self, seconds);
  if (self->agreed.exposure_s == 0 || rounded == self->exposure_s) {
    return CLT_OK;
  }
  clt_status status = clt_libcamera_set_exposure(self->stream, rounded, &self->revision, error);
  if (status == CLT_OK) {
    self->exposure_s = rounded;
    self->settled = 0;
  }
  return status;
}

/* Fills the picture's exposure where the camera does not tell it. False where it is not known. */
static bool settle_exposure(libcamera_camera *self, clt_libcamera_picture *picture) {
  if (picture->exposure_s > 0) {
    return true;
  }
  picture->exposure_s = self->exposure_s;
  self->settled += picture->revision == self->revision;
  return self->agreed.exposure_s == 0 || self->settled > SETTLING;
}

/* The next picture whose exposure is known. */
static clt_status take_known(libcamera_camera *self, int64_t deadline_ns, clt_libcamera_picture *picture,
                             clt_error *error) {
  clt_status status;
  do {
    status = clt_libcamera_take(self->stream, deadline_ns, picture, error);
  } while (status == CLT_OK && !settle_exposure(self, picture));
  if (status == CLT_OK) {
    picture->stamp_ns -= (int64_t)ceil(picture->exposure_s * 1e9);
  }
  return status;
}

static void fill_frame(const libcamera_camera *self, const clt_libcamera_picture *picture, clt_frame *frame) {
  *frame = (clt_frame){.width = self->info.width,
                       .height = self->info.height,
                       .channels = self->info.channels,
                       .bits = self->info.bits,
                       .samples = self->samples,
                       .exposed_ns = picture->stamp_ns,
                       .exposure_s = picture->exposure_s,
                       .sequence = picture->sequence};
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  libcamera_camera *self = (libcamera_camera *)camera;
  int64_t deadline_ns = clt_clock_ns() + (int64_t)(timeout_s * 1e9);
  clt_libcamera_picture picture;
  clt_status status, decoded = CLT_TIMEOUT;
  clt_error damage = {0};
  do {
    status = take_known(self, deadline_ns, &picture, error);
    if (status == CLT_OK && picture.stamp_ns >= not_before_ns) {
      decoded = self->format->decode(self->format, &self->layout, picture.bytes, picture.used, self->samples, &damage);
    }
  } while (status == CLT_OK && decoded == CLT_TIMEOUT);
  if (status == CLT_TIMEOUT && damage.status != CLT_OK) {
    return clt_fail(error, CLT_TIMEOUT, "camera \"%s\" sent only damaged pictures: %s", self->agreed.id,
                    damage.message);
  }
  if (status != CLT_OK) {
    return status;
  }
  fill_frame(self, &picture, frame);
  return decoded == CLT_OK ? CLT_OK : clt_fail(error, decoded, "%s", damage.message);
}

static void close_camera(clt_camera *camera) {
  libcamera_camera *self = (libcamera_camera *)camera;
  if (self != NULL) {
    clt_libcamera_close(self->stream);
    free(self->samples);
    free(self);
  }
}

static const clt_camera_driver driver = {
    .name = "libcamera", .describe = describe, .set_exposure = set_exposure, .next = next, .close = close_camera};

static clt_colour_matrix matrix_of(int ycbcr) {
  return ycbcr == 2020 ? CLT_MATRIX_2020 : ycbcr == 709 ? CLT_MATRIX_709 : CLT_MATRIX_601;
}

static clt_status make_room(libcamera_camera *self, clt_error *error) {
  const clt_libcamera_stream *agreed = &self->agreed;
  self->format = clt_pixels_find(agreed->code);
  self->layout = (clt_picture_layout){.width = agreed->width,
                                      .height = agreed->height,
                                      .stride = agreed->stride,
                                      .size = agreed->size,
                                      .matrix = matrix_of(agreed->ycbcr),
                                      .limited = agreed->limited};
  self->exposure_s = agreed->exposure_s;
  self->info = (clt_camera_info){.width = agreed->width / self->format->shrink,
                                 .height = agreed->height / self->format->shrink,
                                 .channels = self->format->channels,
                                 .bits = self->format->bits,
                                 .exposure_min_s = agreed->exposure_min_s,
                                 .exposure_max_s = agreed->exposure_max_s,
                                 .responsivity = 1,
                                 .full_well = FULL_WELL,
                                 .read_noise = READ_NOISE_CODES * FULL_WELL / ((1 << self->format->bits) - 1),
                                 .own_pixels = true,
                                 .step = clt_pixels_step(self->format, &self->layout)};
  size_t samples = (size_t)self->info.width * (size_t)self->info.height * (size_t)self->info.channels;
  self->samples = clt_alloc(samples, sizeof *self->samples);
  return self->samples != NULL ? CLT_OK
                               : clt_fail(error, CLT_FAILED, "memory is short for a picture of %zu samples", samples);
}

static bool in_effect(const clt_camera_config *config, const libcamera_camera *self,
                      const clt_libcamera_picture *picture) {
  double off = fabs(picture->exposure_s - self->exposure_s);
  bool gain = config->gain < 0 || picture->gain < 0 ||
              fabs(picture->gain - config->gain) <= EXPOSURE_TOLERANCE * fmax(config->gain, 1);
  return gain &&
         (self->agreed.exposure_s == 0 || off <= fmax(EXPOSURE_TOLERANCE * self->exposure_s, EXPOSURE_ROUNDING_S));
}

/* Waits until the settings hold, then measures the time from frame to frame; frames that were left out between two
 * pictures are counted by their sequence numbers. */
static clt_status settle(const clt_camera_config *config, libcamera_camera *self, clt_error *error) {
  int64_t deadline_ns = clt_clock_ns() + (int64_t)(FIRST_S * 1e9);
  clt_libcamera_picture first = {0}, picture = {0};
  clt_status status = CLT_OK;
  int settled = 0;
  for (int k = 0; status == CLT_OK && k < FIRST_MOST && settled <= INTERVALS; k++) {
    status = take_known(self, deadline_ns, &picture, error);
    settled = status == CLT_OK && in_effect(config, self, &picture) ? settled + 1 : 0;
    first = settled == 1 ? picture : first;
  }
  if (status != CLT_OK) {
    return status;
  }
  if (settled <= INTERVALS || picture.stamp_ns <= first.stamp_ns) {
    return clt_fail(error, CLT_FAILED,
                    "camera \"%s\" does not take what is set: exposure %.4g ms, gain %.3g after %d pictures, asked for "
                    "%.4g ms; another driver may (\"v4l2\")",
                    self->agreed.id, picture.exposure_s * 1e3, picture.gain, FIRST_MOST, self->exposure_s * 1e3);
  }
  uint32_t frames = picture.sequence - first.sequence;
  self->info.frame_s = 1e-9 * (double)(picture.stamp_ns - first.stamp_ns) / (frames > 0 ? frames : INTERVALS);
  if (picture.black_level > 0 && self->format->shrink > 1) {
    self->info.black_level = picture.black_level * ((1 << self->info.bits) - 1);
  }
  return CLT_OK;
}

/* A camera with one exposure only. */
static void fix_exposure(libcamera_camera *self) {
  if (self->agreed.exposure_s == 0) {
    self->exposure_s = self->info.frame_s;
    self->info.exposure_min_s = self->info.exposure_max_s = self->info.frame_s;
  }
}

clt_status clt_libcamera_camera_open(const clt_camera_config *config, clt_camera **out, clt_error *error) {
  *out = NULL;
  libcamera_camera *self = calloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "memory is short for a camera");
  }
  self->base.driver = &driver;
  clt_status status = clt_libcamera_open(config, &self->stream, &self->agreed, error);
  status = status == CLT_OK ? make_room(self, error) : status;
  self->revision = 2;
  status = status == CLT_OK ? settle(config, self, error) : status;
  if (status != CLT_OK) {
    close_camera(&self->base);
    return status;
  }
  fix_exposure(self);
  *out = &self->base;
  return CLT_OK;
}
