/* libcamera for C: one camera that streams into a bounded queue. The libcamera*_shim.cpp files implement it; no
 * exception leaves them. Times are nanoseconds of CLOCK_MONOTONIC. */
#ifndef CLT_DEVICE_CAMERA_LIBCAMERA_SHIM_H
#define CLT_DEVICE_CAMERA_LIBCAMERA_SHIM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/device.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_libcamera clt_libcamera;

/* What was agreed with the camera. */
typedef struct clt_libcamera_stream {
  char id[256];      /* libcamera's name of it, the same after unplugging */
  int width, height; /* pixels of the sensor, of one picture */
  uint32_t code;     /* of the decoder (pixels.h) */
  size_t stride, size;
  int ycbcr;                             /* 601, 709, 2020: how Y'CbCr was made of R'G'B' */
  bool limited;                          /* and in which range */
  double exposure_min_s, exposure_max_s; /* both 0 where the camera has no control of the exposure */
  double exposure_step_s;                /* 0: not known */
  double exposure_s;                     /* the one that is asked for from the start; 0 without a control */
} clt_libcamera_stream;

/* One picture, in the camera's own buffer: valid until the next call that takes one. */
typedef struct clt_libcamera_picture {
  const uint8_t *bytes;
  size_t used;
  int64_t stamp_ns;   /* when the first row was read out, which ended its exposure */
  double exposure_s;  /* as the camera tells for this picture; < 0: it does not */
  double gain;        /* likewise */
  double black_level; /* fraction of full scale; < 0: not told */
  uint32_t sequence;
  uint32_t revision; /* the settings that this picture was asked for with (clt_libcamera_set_exposure) */
} clt_libcamera_picture;

/* Opens the camera that config->device names ("auto": the first one; a libcamera identifier or the end of one; a
 * model), sets it, automatic controls off first, and starts it. CLT_GONE where it is not there, CLT_BAD_INPUT where it
 * cannot do what is asked for, CLT_FAILED where another program has it. */
clt_status clt_libcamera_open(const clt_camera_config *config, clt_libcamera **out, clt_libcamera_stream *stream,
                              clt_error *error);
/* Asks for an exposure time within the camera's range with the next request; *revision names these settings. */
clt_status clt_libcamera_set_exposure(clt_libcamera *camera, double seconds, uint32_t *revision, clt_error *error);
/* The oldest picture that waits, or the next one. CLT_TIMEOUT where none came before deadline_ns, CLT_GONE when the
 * camera is no longer there. */
clt_status clt_libcamera_take(clt_libcamera *camera, int64_t deadline_ns, clt_libcamera_picture *picture,
                              clt_error *error);
/* Stops it, in whatever state it is, and frees it; accepts NULL. */
void clt_libcamera_close(clt_libcamera *camera);

#ifdef __cplusplus
}
#endif
#endif
