#include "device/camera/v4l2_format.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* A rate within this part of the one that was asked for is that rate. */
#define RATE_TOLERANCE 0.02
enum { RATES_MAX = 256, CODES_MAX = 256 };

static double seconds(struct v4l2_fract fraction) {
  return fraction.denominator > 0 ? (double)fraction.numerator / fraction.denominator : 0;
}

static void read_rates(const clt_v4l2_node *node, uint32_t code, clt_v4l2_span *span) {
  double shortest = 0, longest = 0;
  for (uint32_t k = 0; k < RATES_MAX; k++) {
    struct v4l2_frmivalenum rate = {
        .index = k, .pixel_format = code, .width = (uint32_t)span->width, .height = (uint32_t)span->height};
    if (clt_v4l2_call(node, VIDIOC_ENUM_FRAMEINTERVALS, &rate) != 0) {
      break;
    }
    bool one = rate.type == V4L2_FRMIVAL_TYPE_DISCRETE;
    double low = seconds(one ? rate.discrete : rate.stepwise.min),
           high = seconds(one ? rate.discrete : rate.stepwise.max);
    shortest = k == 0 || low < shortest ? low : shortest;
    longest = high > longest ? high : longest;
    if (!one) {
      break;
    }
  }
  span->rate_low_hz = longest > 0 ? 1 / longest : 0;
  span->rate_high_hz = shortest > 0 ? 1 / shortest : 0;
}

bool clt_v4l2_size_at(const clt_v4l2_node *node, uint32_t code, uint32_t place, clt_v4l2_span *span) {
  struct v4l2_frmsizeenum size = {.index = place, .pixel_format = code};
  if (clt_v4l2_call(node, VIDIOC_ENUM_FRAMESIZES, &size) != 0 ||
      (place > 0 && size.type != V4L2_FRMSIZE_TYPE_DISCRETE)) {
    return false;
  }
  bool one = size.type == V4L2_FRMSIZE_TYPE_DISCRETE;
  *span = (clt_v4l2_span){.width = (int)(one ? size.discrete.width : size.stepwise.min_width),
                          .height = (int)(one ? size.discrete.height : size.stepwise.min_height),
                          .width_most = (int)(one ? size.discrete.width : size.stepwise.max_width),
                          .height_most = (int)(one ? size.discrete.height : size.stepwise.max_height)};
  read_rates(node, code, span);
  return true;
}

/* Whether a format comes in that size and as fast; a driver that names no sizes is believed to take any. */
static bool offers(const clt_v4l2_node *node, uint32_t code, int width, int height, double rate_hz) {
  clt_v4l2_span span;
  for (uint32_t k = 0; clt_v4l2_size_at(node, code, k, &span); k++) {
    if (width < span.width || width > span.width_most || height < span.height || height > span.height_most) {
      continue;
    }
    if (span.rate_high_hz == 0 || rate_hz == 0 || span.rate_high_hz >= rate_hz * (1 - RATE_TOLERANCE)) {
      return true;
    }
  }
  return !clt_v4l2_size_at(node, code, 0, &span);
}

typedef struct codes {
  int count;
  uint32_t code[CODES_MAX];
} codes;

static void read_codes(const clt_v4l2_node *node, codes *offered) {
  struct v4l2_fmtdesc offer = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
  offered->count = 0;
  for (; offered->count < CODES_MAX && clt_v4l2_call(node, VIDIOC_ENUM_FMT, &offer) == 0; offer.index++) {
    offered->code[offered->count++] = offer.pixelformat;
  }
}

static bool has_code(const codes *offered, uint32_t code) {
  for (int k = 0; k < offered->count; k++) {
    if (offered->code[k] == code) {
      return true;
    }
  }
  return false;
}

/* Deeper samples first, then colours, then the table's order; compressed ones are none the deeper. */
static bool better(const clt_pixel_format *format, const clt_pixel_format *best) {
  return best == NULL || format->depth > best->depth ||
         (format->depth == best->depth && format->channels > best->channels);
}

static clt_status choose_format(const clt_v4l2_node *node, const clt_camera_config *config, int width, int height,
                                const clt_pixel_format **out, clt_error *error) {
  char offered[256] = "", name[5];
  codes there;
  bool any = config->format[0] == '\0' || strcmp(config->format, "auto") == 0;
  const clt_pixel_format *best = NULL, *format;
  read_codes(node, &there);
  for (size_t k = 0; (format = clt_pixels_at(k)) != NULL; k++) {
    clt_pixels_name(format->code, name);
    if (!has_code(&there, format->code)) {
      continue;
    }
    size_t used = strlen(offered);
    snprintf(offered + used, sizeof offered - used, "%s%s", used > 0 ? ", " : "", name);
    bool wanted = any ? offers(node, format->code, width, height, config->rate_hz)
                      : clt_pixels_code(config->format) == format->code;
    if (wanted && better(format, best)) {
      best = format;
    }
  }
  *out = best;
  if (best != NULL) {
    return CLT_OK;
  }
  return any ? clt_fail(error, CLT_BAD_INPUT,
                        "%s: no format that is read (%s) comes in %d x %d pixels at that rate; see `counterlight "
                        "doctor` for sizes and rates",
                        node->path, offered[0] != '\0' ? offered : "none of its own", width, height)
             : clt_fail(error, CLT_BAD_INPUT,
                        "%s: the format \"%s\" is not there; of this camera's, these are read: %s", node->path,
                        config->format, offered[0] != '\0' ? offered : "none");
}

static clt_status set_format(const clt_v4l2_node *node, const clt_pixel_format *format, struct v4l2_format *about,
                             int width, int height, clt_error *error) {
  struct v4l2_pix_format *pix = &about->fmt.pix;
  *about = (struct v4l2_format){.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
  pix->width = (uint32_t)width;
  pix->height = (uint32_t)height;
  pix->pixelformat = format->code;
  pix->field = V4L2_FIELD_NONE;
  int number = clt_v4l2_call(node, VIDIOC_S_FMT, about);
  if (number != 0) {
    return clt_v4l2_fail(node, "setting the format", number, error);
  }
  if (pix->pixelformat != format->code || (int)pix->width != width || (int)pix->height != height) {
    char wanted[5], got[5];
    clt_pixels_name(format->code, wanted);
    clt_pixels_name(pix->pixelformat, got);
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: the camera does not take %s of %d x %d pixels, nearest is %s of %u x %u; see `counterlight "
                    "doctor`",
                    node->path, wanted, width, height, got, pix->width, pix->height);
  }
  if (pix->field != V4L2_FIELD_NONE && pix->field != V4L2_FIELD_ANY) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: the pictures are interlaced, and their halves show different moments; take another format or "
                    "another input of the camera",
                    node->path);
  }
  return CLT_OK;
}

/* The matrix and the range that the driver names, or the kernel's default for its colour space. */
static clt_status read_colours(const clt_v4l2_node *node, const clt_pixel_format *format,
                               const struct v4l2_pix_format *pix, clt_picture_layout *layout, clt_error *error) {
  uint32_t encoding =
      pix->ycbcr_enc != V4L2_YCBCR_ENC_DEFAULT ? pix->ycbcr_enc : V4L2_MAP_YCBCR_ENC_DEFAULT(pix->colorspace);
  uint32_t range = pix->quantization != V4L2_QUANTIZATION_DEFAULT
                       ? pix->quantization
                       : (uint32_t)V4L2_MAP_QUANTIZATION_DEFAULT(!format->differences, pix->colorspace, encoding);
  /* xvYCC has but one range, whatever the driver says. */
  layout->limited = range == V4L2_QUANTIZATION_LIM_RANGE ||
                    (format->differences && (encoding == V4L2_YCBCR_ENC_XV601 || encoding == V4L2_YCBCR_ENC_XV709));
  switch (encoding) {
  case V4L2_YCBCR_ENC_709:
  case V4L2_YCBCR_ENC_XV709:
    layout->matrix = CLT_MATRIX_709;
    return CLT_OK;
  case V4L2_YCBCR_ENC_BT2020:
    layout->matrix = CLT_MATRIX_2020;
    return CLT_OK;
  case V4L2_YCBCR_ENC_SMPTE240M:
    layout->matrix = CLT_MATRIX_240M;
    return CLT_OK;
  case V4L2_YCBCR_ENC_BT2020_CONST_LUM:
    return format->differences
               ? clt_fail(error, CLT_BAD_INPUT,
                          "%s: colours of constant luminance (BT.2020) are not read; take another format", node->path)
               : CLT_OK;
  default: /* also xvYCC 601 and the old sYCC */
    layout->matrix = CLT_MATRIX_601;
    return CLT_OK;
  }
}

static clt_status set_rate(const clt_v4l2_node *node, double rate_hz, double *frame_s, clt_error *error) {
  struct v4l2_streamparm parameters = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
  struct v4l2_captureparm *capture = &parameters.parm.capture;
  *frame_s = 0;
  if (clt_v4l2_call(node, VIDIOC_G_PARM, &parameters) != 0) {
    return rate_hz == 0
               ? CLT_OK
               : clt_fail(error, CLT_BAD_INPUT, "%s: the camera takes no frame rate; leave `rate_hz` out", node->path);
  }
  if (rate_hz > 0) {
    capture->timeperframe = (struct v4l2_fract){1000, (uint32_t)lround(rate_hz * 1000)};
    int number = clt_v4l2_call(node, VIDIOC_S_PARM, &parameters);
    if (number != 0) {
      return clt_v4l2_fail(node, "setting the frame rate", number, error);
    }
  }
  *frame_s = seconds(capture->timeperframe);
  if (rate_hz > 0 && fabs(*frame_s * rate_hz - 1) > RATE_TOLERANCE) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: asked for %g frames a second, the camera takes %.4g; see `counterlight "
                    "doctor` for its rates",
                    node->path, rate_hz, *frame_s > 0 ? 1 / *frame_s : 0);
  }
  return CLT_OK;
}

clt_status clt_v4l2_choose_mode(const clt_v4l2_node *node, const clt_camera_config *config, clt_v4l2_mode *mode,
                                clt_error *error) {
  struct v4l2_format about = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
  *mode = (clt_v4l2_mode){0};
  int number = clt_v4l2_call(node, VIDIOC_G_FMT, &about);
  if (number != 0) {
    return clt_v4l2_fail(node, "asking for its format", number, error);
  }
  int width = config->width > 0 ? config->width : (int)about.fmt.pix.width;
  int height = config->height > 0 ? config->height : (int)about.fmt.pix.height;
  clt_status status = choose_format(node, config, width, height, &mode->format, error);
  if (status == CLT_OK) {
    status = set_format(node, mode->format, &about, width, height, error);
  }
  if (status == CLT_OK) {
    status = read_colours(node, mode->format, &about.fmt.pix, &mode->layout, error);
  }
  if (status == CLT_OK) {
    status = set_rate(node, config->rate_hz, &mode->frame_s, error);
  }
  mode->layout.width = width;
  mode->layout.height = height;
  mode->layout.stride = about.fmt.pix.bytesperline;
  mode->layout.size = about.fmt.pix.sizeimage;
  if (status == CLT_OK) {
    mode->width = width / mode->format->shrink;
    mode->height = height / mode->format->shrink;
  }
  return status;
}
