/* What the effects that spread light over neighbouring cells share. */
#ifndef CLT_SIM_EFFECTS_CELL_BLUR_H
#define CLT_SIM_EFFECTS_CELL_BLUR_H

#include "sim/effects/effect.h"
#include "sim/effects/gaussian.h"

/* Makes a blur of the scene's grid the state of a stage, to be freed by free(): a share (0..1) of the light spreads by
 * a Gaussian of sigma cells, the rest stays. */
clt_status clt_cell_blur_prepare(clt_scene *scene, double sigma, double share, clt_stage *stage, clt_error *error);
/* As clt_effect's drive and radiance. */
void clt_cell_blur_apply(const void *state, float *values, float *scratch);

#endif
