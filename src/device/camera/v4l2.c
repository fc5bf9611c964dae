/* A Video4Linux camera as a device: which frame has which exposure, and when. */
#include "device/camera/v4l2.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/memory.h"
#include "device/camera/v4l2_link.h"

/* After the exposure control was set, frames that begin within so many frames' time may still have the time before:
 * sensors latch a new one for the next frame but one, and it has to get there. */
#define SETTLE_FRAMES 2
/* Not known of a real camera; a calibration measures them. The read noise, in code values, is too little for two equal
 * pictures to be taken for a fault. */
#define FULL_WELL 1e4
#define READ_NOISE_CODES 0.15
#define EXPOSURE_TOLERANCE 0.01

typedef struct v4l2_camera {
  clt_camera base;
  clt_v4l2_link link;
  uint16_t *samples;
  int64_t settled_ns;                 /* frames that begin earlier are not delivered */
  bool unset;                         /* the exposure could not be set: all is to be set again first */
  bool ageless;                       /* its pictures bear no time that can be compared */
  uint32_t sequence, sequence_before; /* of the last frame; of the first frame of this stream */
  long damaged;
} v4l2_camera;

static double longest_exposure(const v4l2_camera *self) {
  double frame_s = self->link.mode.frame_s, most = self->link.locks.exposure_max_s;
  return most < frame_s ? most : frame_s;
}

static void describe(const clt_camera *camera, clt_camera_info *info) {
  const v4l2_camera *self = (const v4l2_camera *)camera;
  const clt_v4l2_mode *mode = &self->link.mode;
  bool timed = self->link.locks.timed;
  *info = (clt_camera_info){.width = mode->width,
                            .height = mode->height,
                            .channels = mode->format->channels,
                            .bits = mode->format->bits,
                            .frame_s = mode->frame_s,
                            .exposure_min_s = timed ? self->link.locks.exposure_min_s : mode->frame_s,
                            .exposure_max_s = timed ? longest_exposure(self) : mode->frame_s,
                            .responsivity = 1,
                            .full_well = FULL_WELL,
                            .read_noise = READ_NOISE_CODES * FULL_WELL / ((1 << mode->format->bits) - 1),
                            .own_pixels = true,
                            .step = clt_pixels_step(mode->format, &mode->layout)};
}

static double exposure(const v4l2_camera *self) {
  return self->link.locks.timed ? self->link.locks.exposure_s : self->link.mode.frame_s;
}

/* Called when the exposure was changed or all was set anew; longest: of the exposure times before and after. */
static void unsettle(v4l2_camera *self, double longest) {
  double frame_s = fmax(self->link.mode.frame_s, longest);
  self->settled_ns = clt_clock_ns() + (int64_t)(SETTLE_FRAMES * frame_s * 1e9);
}

static clt_status set_exposure(clt_camera *camera, double seconds, clt_error *error) {
  v4l2_camera *self = (v4l2_camera *)camera;
  clt_camera_info info;
  describe(camera, &info);
  if (!(seconds >= info.exposure_min_s * (1 - EXPOSURE_TOLERANCE) &&
        seconds <= info.exposure_max_s * (1 + EXPOSURE_TOLERANCE))) {
    return clt_fail(error, CLT_BAD_INPUT, "an exposure of %g s; the camera takes %g to %g s at %g frames a second%s",
                    seconds, info.exposure_min_s, info.exposure_max_s, 1 / info.frame_s,
                    self->link.locks.timed ? "; set a lower camera.rate_hz for longer ones" : "");
  }
  if (!self->link.locks.timed || clt_v4l2_exposure_is(&self->link.locks, seconds)) {
    return CLT_OK;
  }
  double before = exposure(self);
  clt_status status = self->link.node.fd < 0 ? clt_fail(error, CLT_GONE, "the camera is away")
                                             : clt_v4l2_expose(&self->link.node, seconds, &self->link.locks, error);
  /* next() waits for the camera or treats it, and then sets everything. */
  if (status == CLT_GONE || status == CLT_TIMEOUT) {
    clt_v4l2_expose_later(seconds, &self->link.locks);
    self->unset = true;
    status = CLT_OK;
  }
  unsettle(self, fmax(before, exposure(self)));
  return status;
}

/* When the exposure of a picture's first row began, or earlier. uvcvideo's stamp of the exposure's start is when the
 * first bytes came, and those are sent when the first rows were exposed. A stamp at the picture's end comes one
 * exposure and the reading of the sensor later, which takes a frame's time at most. */
static int64_t exposed_at(const v4l2_camera *self, const clt_v4l2_picture *picture) {
  double before = picture->at_exposure ? 0 : self->link.mode.frame_s + exposure(self);
  if (picture->at_exposure && strcmp(self->link.node.driver, "uvcvideo") == 0) {
    before = exposure(self);
  }
  return picture->stamp_ns - (int64_t)(before * 1e9);
}

static clt_status read_picture(v4l2_camera *self, const clt_v4l2_picture *picture, clt_frame *frame, clt_error *error) {
  const clt_v4l2_mode *mode = &self->link.mode;
  clt_status status =
      picture->damaged
          ? clt_fail(error, CLT_TIMEOUT, "%s: the driver says that a picture is damaged", self->link.node.path)
          : mode->format->decode(mode->format, &mode->layout, picture->bytes, picture->used, self->samples, error);
  *frame = (clt_frame){.width = mode->width,
                       .height = mode->height,
                       .channels = mode->format->channels,
                       .bits = mode->format->bits,
                       .samples = self->samples,
                       .exposed_ns = exposed_at(self, picture),
                       .exposure_s = exposure(self),
                       .sequence = self->sequence};
  return status;
}

/* Tells of the first damaged picture, the second, the fourth, ... */
static void count_damaged(v4l2_camera *self, const clt_error *error) {
  self->damaged++;
  if ((self->damaged & (self->damaged - 1)) == 0) {
    clt_log(CLT_LOG_WARNING, "%s (%ld so far)", error->message, self->damaged);
  }
}

/* Whether the picture is good and begins late enough: then frame has it. Fails for other reasons than damage. */
static clt_status look_at(v4l2_camera *self, const clt_v4l2_picture *picture, int64_t not_before_ns, clt_frame *frame,
                          bool *wanted, clt_error *error) {
  int64_t start = exposed_at(self, picture);
  self->sequence = self->sequence_before + picture->sequence;
  *wanted = start >= not_before_ns && start >= self->settled_ns;
  clt_status status = *wanted || picture->damaged ? read_picture(self, picture, frame, error) : CLT_OK;
  if (status == CLT_OK) {
    clt_v4l2_link_good(&self->link);
  } else if (status == CLT_TIMEOUT) {
    count_damaged(self, error);
    *wanted = false;
    status = CLT_OK;
  }
  return status;
}

/* The first good picture that begins late enough; CLT_TIMEOUT at the limit, or when the camera is stalled. */
static clt_status await(v4l2_camera *self, int64_t not_before_ns, int64_t limit_ns, clt_frame *frame,
                        clt_error *error) {
  for (;;) {
    clt_v4l2_picture picture;
    clt_error giving = {0};
    bool wanted = false;
    int64_t patience = clt_v4l2_link_patience(&self->link);
    clt_status status = clt_v4l2_stream_take(&self->link.node, &self->link.stream,
                                             limit_ns < patience ? limit_ns : patience, &picture, error);
    if (status == CLT_OK) {
      status = look_at(self, &picture, not_before_ns, frame, &wanted, error);
      clt_status given = clt_v4l2_stream_give(&self->link.node, picture.index, &giving);
      /* Where the camera went after a picture that is wanted, the next call finds out. */
      if (status == CLT_OK && !wanted && given != CLT_OK) {
        return clt_fail(error, CLT_GONE, "%s", giving.message);
      }
    }
    if (status != CLT_OK || wanted) {
      return status;
    }
    int64_t now = clt_clock_ns();
    if (now >= limit_ns || now >= clt_v4l2_link_patience(&self->link)) {
      return clt_fail(error, CLT_TIMEOUT, "%s: no picture of the wanted time and exposure came", self->link.node.path);
    }
  }
}

/* Pictures without a time that can be compared may be of any age while nobody took them. */
static void drop_ageless(v4l2_camera *self) {
  clt_v4l2_picture picture;
  for (int k = 0; self->ageless && k < CLT_V4L2_BUFFERS; k++) {
    if (clt_v4l2_stream_take(&self->link.node, &self->link.stream, 0, &picture, NULL) != CLT_OK) {
      return;
    }
    self->ageless = !picture.monotonic;
    clt_v4l2_stream_give(&self->link.node, picture.index, NULL);
  }
}

/* The camera was set and started anew: frames are counted on, and exposures have to settle. */
static void begin_again(v4l2_camera *self) {
  self->sequence_before = self->sequence + 1;
  self->unset = false;
  unsettle(self, exposure(self));
}

/* Has the camera there, or waits for it until the limit. */
static clt_status attend(v4l2_camera *self, int64_t limit_ns, clt_error *error) {
  if (self->unset) {
    clt_v4l2_link_close(&self->link);
  }
  if (self->link.node.fd >= 0) {
    return CLT_OK;
  }
  clt_status status = clt_v4l2_link_restore(&self->link, limit_ns, error);
  if (status == CLT_OK) {
    begin_again(self);
  }
  return status;
}

static clt_status next(clt_camera *camera, int64_t not_before_ns, double timeout_s, clt_frame *frame,
                       clt_error *error) {
  v4l2_camera *self = (v4l2_camera *)camera;
  clt_error problem = {0};
  int64_t limit = clt_clock_ns() + (int64_t)(timeout_s * 1e9);
  clt_status status;
  for (;;) {
    status = attend(self, limit, &problem);
    if (status != CLT_OK) {
      break;
    }
    drop_ageless(self);
    status = await(self, not_before_ns, limit, frame, &problem);
    if ((status != CLT_GONE && status != CLT_TIMEOUT) || clt_clock_ns() >= limit) {
      break;
    }
    if (clt_v4l2_link_treat(&self->link, &problem)) {
      begin_again(self);
    }
  }
  if (status != CLT_OK && error != NULL) {
    *error = problem;
  }
  return status;
}

static void close_camera(clt_camera *camera) {
  v4l2_camera *self = (v4l2_camera *)camera;
  if (self != NULL) {
    clt_v4l2_link_close(&self->link);
    free(self->samples);
    free(self);
  }
}

static const clt_camera_driver driver = {"v4l2", describe, set_exposure, next, close_camera};

static void announce(const v4l2_camera *self) {
  const clt_v4l2_link *link = &self->link;
  char name[CLT_PATH_MAX], format[5];
  clt_v4l2_stable_name(&link->node, &link->identity, name, sizeof name);
  clt_pixels_name(link->mode.format->code, format);
  clt_log(CLT_LOG_INFO, "camera \"%s\" (%s, now %s): %s, %d x %d pixels, %.4g frames a second", link->node.card, name,
          link->node.path, format, link->mode.layout.width, link->mode.layout.height, 1 / link->mode.frame_s);
}

clt_status clt_v4l2_open(const clt_camera_config *config, clt_camera **out, clt_error *error) {
  v4l2_camera *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a camera");
  }
  self->base.driver = &driver;
  self->ageless = true;
  clt_status status = clt_v4l2_link_open(config, &self->link, error);
  if (status != CLT_OK) {
    free(self);
    return status;
  }
  const clt_v4l2_mode *mode = &self->link.mode;
  self->samples =
      clt_alloc((size_t)mode->width * (size_t)mode->height, (size_t)mode->format->channels * sizeof *self->samples);
  if (self->samples == NULL) {
    close_camera(&self->base);
    return clt_fail(error, CLT_FAILED, "out of memory for pictures of %d x %d pixels", mode->width, mode->height);
  }
  unsettle(self, exposure(self));
  announce(self);
  *out = &self->base;
  return CLT_OK;
}
