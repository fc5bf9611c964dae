/* What cameras libcamera knows and what each can do: for a person who writes a configuration, and for
 * `counterlight doctor`. There only where the feature libcamera is built (CLT_HAVE_LIBCAMERA). */
#ifndef CLT_DEVICE_CAMERA_LIBCAMERA_LIST_H
#define CLT_DEVICE_CAMERA_LIBCAMERA_LIST_H

#include <stdbool.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_libcamera_offer {
  char code[5];      /* as the configuration's `format`; empty where it is not read */
  char name[32];     /* libcamera's name */
  bool raw;          /* from the stream of the sensor itself */
  int width, height; /* the greatest */
} clt_libcamera_offer;

typedef struct clt_libcamera_setting {
  char name[32];
  double least, most, standard; /* of libcamera's unit; truth values as 0 and 1; all 0 for what is no number */
  bool automatic;               /* the camera changes its picture by itself through it; the driver switches it off */
} clt_libcamera_setting;

typedef struct clt_libcamera_camera {
  char id[256]; /* what to write as `device`: it survives unplugging and starting again */
  char model[64];
  int offer_count, setting_count;
  clt_libcamera_offer *offers;
  clt_libcamera_setting *settings;
} clt_libcamera_camera;

/* Owned by the struct; a zeroed one is empty. */
typedef struct clt_libcamera_cameras {
  int count;
  clt_libcamera_camera *camera;
} clt_libcamera_cameras;

/* "0.0.3" */
const char *clt_libcamera_version(void);
/* Asks every camera, without taking it. No camera is no failure. */
clt_status clt_libcamera_list(clt_libcamera_cameras *cameras, clt_error *error);
void clt_libcamera_cameras_finish(clt_libcamera_cameras *cameras);

#ifdef __cplusplus
}
#endif
#endif
