/* The geometry of a rig: which panel coordinate each camera pixel sees, by structured light. */
#ifndef CLT_RIG_GEOMETRY_GEOMETRY_H
#define CLT_RIG_GEOMETRY_GEOMETRY_H

#include <stdbool.h>

#include "counterlight/image.h"
#include "rig/finding.h"
#include "rig/geometry/decode.h"
#include "rig/geometry/drift.h"
#include "rig/geometry/regions.h"
#include "rig/shots.h"

typedef struct clt_geometry_options {
  clt_gray gray;
  double exposure_s;
  clt_curve response; /* of the camera */
  long region_pixels; /* least size of a masked region worth a line; 0: one in 25000 of the camera's pixels */
  /* Called after each picture; false stops (CLT_CANCELLED). May be NULL. */
  bool (*progress)(void *context, int done, int total);
  void *context;
} clt_geometry_options;

/* Owns its map. A zeroed one is valid and empty. */
typedef struct clt_geometry {
  clt_pixel_map map;
  clt_decode_report decode;
  clt_regions regions;
  clt_drift drift;
} clt_geometry;

/* Shows the Gray code on shots' panel, takes a frame of each picture, and decodes them. What is wrong goes to findings.
 * CLT_BAD_INPUT where the panel is not that of the code; else as the devices fail. On failure geometry is empty. */
clt_status clt_geometry_measure(clt_shots *shots, const clt_geometry_options *options, clt_geometry *geometry,
                                clt_findings *findings, clt_error *error);
void clt_geometry_finish(clt_geometry *geometry); /* accepts an empty one */

#endif
