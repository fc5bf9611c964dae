#include <string.h>

#include "sim/scene_file.h"

const clt_material *clt_scene_find_material(const clt_material *materials, int count, const char *name) {
  for (int k = 0; k < count; k++) {
    if (materials[k].name != NULL && strcmp(materials[k].name, name) == 0) {
      return &materials[k];
    }
  }
  return NULL;
}

/* `gloss`, and that no more light comes back than came. */
static void read_gloss(clt_section item, int channels, const double *albedo, clt_gloss *gloss) {
  clt_section section = clt_section_group(item, "gloss");
  clt_scene_read_channels(section, "strength", channels, 0.0, 0.0, 1.0, gloss->strength);
  gloss->exponent = clt_read_number(section, "exponent", 50.0, 1.0, 1e5);
  if (clt_section_has(item, "gloss") && !clt_section_has(section, "strength")) {
    clt_section_fail(item, "gloss", "needs strength, the fraction of the light that comes back in the lobe");
  }
  for (int c = 0; c < channels; c++) {
    if (albedo[c] + gloss->strength[c] >= 1.0) {
      clt_section_fail(section, "strength", "%g and albedo %g are %g together; legal is below 1", gloss->strength[c],
                       albedo[c], gloss->strength[c] + albedo[c]);
    }
  }
}

int clt_scene_read_materials(clt_section root, clt_scene_description *description, clt_material *materials) {
  int count = clt_section_count(root, "materials"), channels = description->channels;
  if (count > CLT_MATERIALS_MAX) {
    clt_section_fail(root, "materials", "has %d materials; legal is at most %d", count, CLT_MATERIALS_MAX);
    return 0;
  }
  for (int k = 0; k < count; k++) {
    clt_section item = clt_section_item(root, "materials", k);
    materials[k].name = clt_read_text(item, "name", NULL, 64);
    if (materials[k].name == NULL) {
      clt_section_fail(item, NULL, "a material needs name = \"...\"");
    } else if (clt_scene_find_material(materials, k, materials[k].name) != NULL) {
      clt_section_fail(item, "name", "\"%s\" is given to two materials", materials[k].name);
    }
    clt_scene_read_channels(item, "albedo", channels, 0.5, 0.0, 1.0, materials[k].albedo);
    for (int c = 0; c < channels; c++) {
      if (materials[k].albedo[c] >= 1.0) {
        clt_section_fail(item, "albedo", "is %g; legal is 0 to below 1", materials[k].albedo[c]);
      }
    }
    read_gloss(item, channels, materials[k].albedo, &description->gloss[k]);
  }
  return count;
}
