/* Where surfaces stand in the way: of the projector's light, of the camera's view, and of light between two others. */
#ifndef CLT_SIM_OCCLUSION_H
#define CLT_SIM_OCCLUSION_H

#include "sim/cells.h"

typedef struct clt_occlusion {
  int shading;        /* cells whose middle ray meets a surface that clearly stands before the front of another */
  int hidden, partly; /* lit cells of which a camera with a pose of its own sees nothing; a part */
  /* Of width x height points spread over such a camera's picture: those in which it sees a front that the projector's
   * picture would light, were nothing between; and those of them in the projector's shadow. */
  int viewed, shadowed;
  int parted; /* pairs of surfaces that face each other with others perhaps between */
} clt_occlusion;

clt_status clt_occlusion_find(const clt_scene_description *description, const clt_visibility *visibility,
                              const clt_cells *cells, clt_occlusion *out, clt_error *error);

#endif
