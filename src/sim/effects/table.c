#include "sim/effects/effect.h"

extern const clt_effect clt_effect_interreflection, clt_effect_occlusion, clt_effect_ambient,
    clt_effect_projector_black, clt_effect_projector_response, clt_effect_crosstalk, clt_effect_latency,
    clt_effect_vignetting, clt_effect_noise, clt_effect_saturation, clt_effect_camera_response, clt_effect_quantisation;

/* Named in every answer, though this version does not simulate them. */
static const clt_effect gloss = {.name = "gloss"}, subsurface = {.name = "subsurface"}, defocus = {.name = "defocus"},
                        flicker = {.name = "flicker"}, lens_blur = {.name = "lens-blur"},
                        rolling_shutter = {.name = "rolling-shutter"}, faults = {.name = "faults"},
                        drift = {.name = "drift"}, vibration = {.name = "vibration"}, change = {.name = "change"};

const clt_effect *const clt_effects[CLT_EFFECTS] = {
    /* panel */
    &clt_effect_latency, &clt_effect_projector_response, &clt_effect_crosstalk, &defocus,
    /* room: the black gains ambient light first, then the leak */
    &clt_effect_interreflection, &clt_effect_occlusion, &gloss, &subsurface, &clt_effect_ambient,
    &clt_effect_projector_black,
    /* time */
    &drift, &flicker, &change, &vibration, &rolling_shutter, &faults,
    /* camera */
    &clt_effect_vignetting, &lens_blur, &clt_effect_noise, &clt_effect_saturation, &clt_effect_camera_response,
    &clt_effect_quantisation};
