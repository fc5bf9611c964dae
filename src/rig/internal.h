/* The camera rig: state that its files share. */
#ifndef CLT_RIG_INTERNAL_H
#define CLT_RIG_INTERNAL_H

#include "counterlight/rig.h"
#include "rig/agreement.h"
#include "rig/footprint.h"
#include "rig/merge.h"
#include "rig/shots.h"

typedef struct clt_camera_rig {
  clt_rig base;
  clt_rig_config config;
  clt_shots shots;
  char response[32]; /* the projector's curve as text */
  clt_footprints footprints;
  clt_merge merge;
  clt_agreement agreement; /* empty where nothing is verified */
  float *codes;            /* panel values, [(c * panel height + y) * panel width + x] */
  long doubted;            /* patterns whose exposures contradicted each other at first */
  long strange, torn;      /* frames that carried another picture's number; that contradicted the others */
} clt_camera_rig;

/* clt_rig_operations.observe of the camera rig. */
clt_status clt_camera_rig_observe(clt_rig *rig, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                                  clt_error *error);

#endif
