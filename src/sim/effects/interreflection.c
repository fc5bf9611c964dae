/* Light that goes from surface to surface: the part of T off its diagonal. */
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "sim/appearance.h"
#include "sim/state.h"

/* Pairs of cells that exchange light in some channel, at least; -1 where T is not held entry by entry. */
static double exchanging_pairs(const clt_scene *scene) {
  size_t cells = (size_t)scene->description.width * (size_t)scene->description.height, most = 0;
  for (int c = 0; c < scene->description.channels; c++) {
    const float *entries = clt_transport_entries(scene->transport, c);
    if (entries == NULL) {
      return -1.0;
    }
    size_t count = 0;
#pragma omp parallel for reduction(+ : count)
    for (size_t i = 0; i < cells; i++) {
      for (size_t j = 0; j < i; j++) {
        count += entries[i * cells + j] != 0.0f || entries[j * cells + i] != 0.0f;
      }
    }
    most = count > most ? count : most;
  }
  return (double)most;
}

/* A transport file says nothing but its entries. */
static bool called_for_by_file(const clt_scene *scene, char *why) {
  double pairs = exchanging_pairs(scene);
  snprintf(why, CLT_EFFECT_WHY_MAX,
           pairs < 0.0    ? "the transport file says how cells light each other"
           : pairs == 0.0 ? "in the transport file no cell lights another"
                          : "in the transport file %.0f pairs of cells exchange light",
           pairs);
  return pairs != 0.0;
}

static bool called_for(const clt_scene *scene, char *why) {
  int surfaces = scene->description.surface_count;
  const clt_light_facts *light = &scene->light;
  if (surfaces == 0) {
    return called_for_by_file(scene, why);
  }
  if (light->exchanging > 0) {
    snprintf(why, CLT_EFFECT_WHY_MAX, "%d of %d pairs of surfaces face each other: %d of %d surfaces exchange light",
             light->facing, surfaces * (surfaces - 1) / 2, light->exchanging, surfaces);
  } else {
    snprintf(why, CLT_EFFECT_WHY_MAX,
             surfaces == 1        ? "one flat surface: nothing to exchange light with"
             : light->facing == 0 ? "no two surfaces face each other"
                                  : "the surfaces that face each other send nothing back into the picture");
  }
  return light->exchanging > 0;
}

static void finish(void *state) {
  if (state != NULL) {
    clt_appearance_finish(state);
    free(state);
  }
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  clt_appearance *appearance = clt_alloc(1, sizeof *appearance);
  stage->state = appearance;
  if (appearance == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
  }
  stage->prepare_ms = scene->light_ms;
  clt_status status = clt_appearance_init(appearance, scene->transport, error);
  stage->bytes = clt_transport_describe(scene->transport).bytes + clt_appearance_bytes(appearance);
  return status;
}

static void light(void *state, const float *drive, float *radiance) {
  clt_appearance_of(state, drive, radiance);
}

const clt_effect clt_effect_interreflection = {
    .name = "interreflection", .called_for = called_for, .prepare = prepare, .finish = finish, .light = light};
