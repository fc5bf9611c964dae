#include "sim/effects/effect.h"

extern const clt_effect clt_effect_latency, clt_effect_projector_response, clt_effect_crosstalk, clt_effect_defocus,
    clt_effect_interreflection, clt_effect_occlusion, clt_effect_gloss, clt_effect_subsurface, clt_effect_ambient,
    clt_effect_projector_black, clt_effect_drift, clt_effect_flicker, clt_effect_change, clt_effect_vibration,
    clt_effect_rolling_shutter, clt_effect_faults, clt_effect_lens_blur, clt_effect_vignetting, clt_effect_noise,
    clt_effect_saturation, clt_effect_camera_response, clt_effect_quantisation;

const clt_effect *const clt_effects[CLT_EFFECTS] = {
    /* panel */
    &clt_effect_latency, &clt_effect_projector_response, &clt_effect_crosstalk, &clt_effect_defocus,
    /* room: the black gains ambient light first, then the leak */
    &clt_effect_interreflection, &clt_effect_occlusion, &clt_effect_gloss, &clt_effect_subsurface, &clt_effect_ambient,
    &clt_effect_projector_black,
    /* time */
    &clt_effect_drift, &clt_effect_flicker, &clt_effect_change, &clt_effect_vibration, &clt_effect_rolling_shutter,
    &clt_effect_faults,
    /* camera */
    &clt_effect_lens_blur, &clt_effect_vignetting, &clt_effect_noise, &clt_effect_saturation,
    &clt_effect_camera_response, &clt_effect_quantisation};
