/* Reading a scene file in parts: what the parts share. Problems are kept in the section's settings. */
#ifndef CLT_SIM_SCENE_FILE_H
#define CLT_SIM_SCENE_FILE_H

#include "base/settings.h"
#include "sim/description.h"

/* A point or direction `key = [x, y, z]`, m. */
clt_vector clt_scene_read_vector(clt_section section, const char *key, clt_vector fallback);
/* One number for every channel, or one per channel; values has room for CLT_SIM_CHANNELS_MAX. */
void clt_scene_read_channels(clt_section section, const char *key, int channels, double fallback, double low,
                             double high, double *values);
/* A material's name, which lives as long as the settings, and its diffuse reflectance; its gloss stands in the
 * description under the material's number. */
typedef struct clt_material {
  const char *name;
  double albedo[CLT_SIM_CHANNELS_MAX];
} clt_material;

/* `materials`, CLT_MATERIALS_MAX at most; returns their number. */
int clt_scene_read_materials(clt_section root, clt_scene_description *description, clt_material *materials);
/* NULL where none of the materials has that name. */
const clt_material *clt_scene_find_material(const clt_material *materials, int count, const char *name);
/* The keys of the camera that say what its pixels are; its pose was read. */
void clt_scene_read_pixels(clt_section section, clt_scene_description *description);
/* `materials` and `surfaces`; the description's channels are known. */
void clt_scene_read_surfaces(clt_section root, clt_scene_description *description);
/* Refuses a projector whose light meets no front of a surface. */
void clt_scene_check_lit(clt_section root, const clt_scene_description *description);

/* Refuses a camera that sees nothing of what the projector lights. */
void clt_scene_check_seen(clt_section root, const clt_scene_description *description);

#endif
