/* The stages that a scene calls for, and running them. */
#ifndef CLT_SIM_EFFECTS_PLAN_H
#define CLT_SIM_EFFECTS_PLAN_H

#include "sim/effects/effect.h"

typedef struct clt_plan {
  int count;
  clt_stage stages[CLT_EFFECTS];
  size_t values;           /* channels * cells */
  bool per_row, per_pixel; /* of any stage */
  int layers;              /* of the radiance: 2 for a camera with pixels of its own (sim/view.h), else 1 */
  float *diagonal;         /* values entries of a diagonal T; NULL where a stage has `light` */
  float *work, *scratch;   /* values and 2 * values; there where a stage has `drive` or `radiance` */
} clt_plan;

/* Reads the keys of every effect. */
void clt_effects_read(clt_section root, clt_scene_description *description);

/* Prepares the effects that the scene calls for. scene->plan was zeroed and is finished by the caller in either case.
 */
clt_status clt_plan_compile(clt_scene *scene, clt_error *error);
void clt_plan_finish(clt_plan *plan);

/* True where a stage has the function that `has` looks for. */
bool clt_plan_any(const clt_plan *plan, bool (*has)(const clt_effect *effect));
bool clt_effect_has_expose(const clt_effect *effect);
bool clt_effect_has_signal(const clt_effect *effect);
bool clt_effect_has_electrons(const clt_effect *effect);

/* What the panel's drive becomes on its way to the surfaces, in place; scratch: 2 * values entries, or NULL where no
 * stage has `drive` or `radiance`. */
void clt_plan_drive(const clt_plan *plan, float *drive, float *scratch);
/* What happens to the radiance of the surfaces on its way to the camera, in place. */
void clt_plan_radiance(const clt_plan *plan, float *radiance, float *scratch);
/* radiance = what the camera sees under a drive of the panel, black included, in as many layers as the plan has;
 * context is the scene. One call at a time. */
void clt_plan_light(void *context, const float *drive, float *radiance);

bool clt_plan_away(const clt_plan *plan, int64_t from_ns, int64_t to_ns);
clt_fate clt_plan_frame(const clt_plan *plan, uint32_t sequence);
void clt_plan_expose(const clt_plan *plan, clt_exposure *exposure, const clt_band *bands, int count);
void clt_plan_signal(const clt_plan *plan, clt_signal *signal);
void clt_plan_electrons(const clt_plan *plan, clt_signal *signal);
void clt_plan_samples(const clt_plan *plan, clt_row *row);

#endif
