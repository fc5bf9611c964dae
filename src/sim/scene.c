#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "sim/state.h"

static clt_status out_of_memory(const clt_scene *scene, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s: out of memory", scene->description.path);
}

/* T 1, and room for what the effects add to the black. */
static clt_status take_flood(clt_scene *scene, clt_error *error) {
  const clt_scene_description *description = &scene->description;
  size_t cells = (size_t)description->width * (size_t)description->height, channels = (size_t)description->channels;
  scene->flood = clt_alloc(channels * cells, sizeof *scene->flood);
  scene->added = clt_alloc(channels * cells, sizeof *scene->added);
  if (scene->flood == NULL || scene->added == NULL) {
    return out_of_memory(scene, error);
  }
  for (size_t k = 0; k < channels * cells; k++) {
    scene->added[k] = 1.0;
  }
  clt_transport_apply_all(scene->transport, scene->added, scene->flood);
  memset(scene->added, 0, channels * cells * sizeof *scene->added);
  for (size_t c = 0; c < channels; c++) {
    scene->full_drive[c] = 1.0;
  }
  return CLT_OK;
}

/* b0 = what the transport brings + what the effects added. */
static void complete_black(clt_scene *scene) {
  size_t cells = (size_t)scene->description.width * (size_t)scene->description.height;
  for (int c = 0; c < scene->description.channels; c++) {
    float *black = clt_transport_black(scene->transport, c);
    for (size_t i = 0; i < cells; i++) {
      size_t k = (size_t)c * cells + i;
      black[i] += (float)scene->added[k];
      scene->brightest = fmax(scene->brightest, (double)black[i] + scene->full_drive[c] * scene->flood[k]);
    }
  }
}

/* The panel's codes as drive in equal steps, which projector-response changes. */
static clt_status lay_out_codes(clt_scene *scene, clt_error *error) {
  int codes = 1 << scene->description.projector.bits;
  scene->drive_of_code = clt_alloc((size_t)codes, sizeof *scene->drive_of_code);
  if (scene->drive_of_code == NULL) {
    return out_of_memory(scene, error);
  }
  for (int code = 0; code < codes; code++) {
    scene->drive_of_code[code] = (float)((double)code / (codes - 1));
  }
  return CLT_OK;
}

static const char *base_name(const char *path) {
  const char *slash = strrchr(path, '/');
  return slash != NULL ? slash + 1 : path;
}

static void complete_provenance(clt_scene *scene) {
  clt_provenance *provenance = clt_transport_provenance(scene->transport);
  *provenance = (clt_provenance){.scheme = "simulated", .error = -1.0};
  snprintf(provenance->source, sizeof provenance->source, "%s", base_name(scene->description.path));
  clt_curve_format(&scene->description.projector.response, provenance->response, sizeof provenance->response);
}

/* What the pixels of a camera see that has pixels of its own. */
static clt_status take_view(clt_scene *scene, clt_error *error) {
  int64_t start_ns = clt_clock_ns();
  clt_status status =
      scene->description.camera.own_pixels ? clt_view_init(&scene->view, &scene->description, error) : CLT_OK;
  scene->view_ms = 1e3 * clt_clock_since(start_ns);
  return status;
}

/* The described responsivity, or one at which the brightest cell fills 0.7 of the well within a refresh period. */
static double choose_responsivity(const clt_scene *scene) {
  const clt_scene_description *description = &scene->description;
  if (description->camera.responsivity > 0.0) {
    return description->camera.responsivity;
  }
  return scene->brightest > 0.0 ? 0.7 / (scene->brightest * description->projector.refresh_s) : 1.0;
}

static clt_status take_transport(clt_scene *scene, clt_error *error) {
  int64_t start_ns = clt_clock_ns();
  clt_status status = CLT_OK;
  if (scene->description.transport != NULL) {
    scene->transport = scene->description.transport;
    scene->description.transport = NULL;
  } else {
    status = clt_light_transport(&scene->description, &scene->transport, &scene->light, error);
  }
  scene->light_ms = 1e3 * clt_clock_since(start_ns);
  return status;
}

static clt_status prepare(clt_scene *scene, const char *path, clt_error *error) {
  clt_status (*const steps[])(clt_scene *, clt_error *) = {take_transport, take_flood, lay_out_codes, take_view,
                                                           clt_plan_compile};
  clt_status status = clt_scene_read(path, &scene->description, error);
  for (size_t k = 0; k < sizeof steps / sizeof steps[0] && status == CLT_OK; k++) {
    status = steps[k](scene, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  complete_black(scene);
  complete_provenance(scene);
  scene->responsivity = choose_responsivity(scene);
  scene->timeline = (clt_timeline){
      .light = clt_plan_light, .context = scene, .values = scene->plan.values, .layers = scene->plan.layers};
  return clt_timeline_init(&scene->timeline, error);
}

clt_status clt_scene_open(const char *path, clt_scene **out, clt_error *error) {
  clt_scene *scene = clt_alloc(1, sizeof *scene);
  if (scene == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory", path);
  }
  pthread_mutex_init(&scene->lock, NULL);
  clt_status status = prepare(scene, path, error);
  if (status != CLT_OK) {
    clt_scene_close(scene);
    return status;
  }
  *out = scene;
  return CLT_OK;
}

void clt_scene_close(clt_scene *scene) {
  if (scene != NULL) {
    clt_timeline_finish(&scene->timeline);
    clt_plan_finish(&scene->plan);
    clt_view_finish(&scene->view);
    free(scene->flood);
    free(scene->added);
    free(scene->drive_of_code);
    clt_transport_destroy(scene->transport);
    clt_scene_description_finish(&scene->description);
    pthread_mutex_destroy(&scene->lock);
    free(scene);
  }
}

const clt_transport *clt_scene_transport(const clt_scene *scene) {
  return scene->transport;
}

/* Exposures 1 : 8 : 64 of whole refresh periods, of which the shortest leaves the brightest cell room below full well,
 * less than a period only where a whole one would saturate it. */
static void choose_exposures(const clt_scene *scene, clt_rig_config *config) {
  const double filled = 0.8, longest_s = 2.0;
  double refresh_s = scene->description.projector.refresh_s;
  double fitting_s = filled / (scene->responsivity * fmax(scene->brightest, 1e-30));
  double shortest_s = fmin(fitting_s, longest_s / 8.0);
  if (shortest_s >= refresh_s) {
    shortest_s = floor(shortest_s / refresh_s + 1e-9) * refresh_s;
  }
  double longest = fmax(1.0, floor(longest_s / shortest_s + 1e-9));
  config->exposure_count = 0;
  for (double factor = 1.0; factor <= 64.0; factor *= 8.0) {
    double exposure_s = fmax(fmin(factor, longest) * shortest_s, CLT_EXPOSURE_MIN_S);
    if (config->exposure_count == 0 || exposure_s > config->exposures_s[config->exposure_count - 1]) {
      config->exposures_s[config->exposure_count++] = exposure_s;
    }
  }
}

void clt_scene_rig_config(const clt_scene *scene, clt_rig_config *config) {
  const clt_scene_description *description = &scene->description;
  *config = (clt_rig_config){.width = description->width,
                             .height = description->height,
                             .projector = clt_panel_of_curve(&description->projector.response),
                             .camera = description->camera.response,
                             .latency_s = description->projector.latency_s + description->projector.jitter_s +
                                          description->projector.refresh_s,
                             .attempts = 3};
  if (description->channels == CLT_PANEL_CHANNELS) { /* channels that look alike stay as they are */
    double light[CLT_PANEL_CHANNELS * CLT_PANEL_CHANNELS];
    memcpy(light, description->effects.crosstalk, sizeof light);
    clt_panel_set_crosstalk(&config->projector, light, NULL);
  }
  choose_exposures(scene, config);
  double longest_s = fmax(config->exposures_s[config->exposure_count - 1], description->camera.frame_s);
  config->timeout_s = 1.0 + config->latency_s + longest_s * (description->camera.exposure_delay + 3);
  const clt_effects_description *effects = &description->effects;
  config->timeout_s = config->timeout_s / (1.0 - effects->faults.dropped) + effects->faults.late_s;
  snprintf(config->source, sizeof config->source, "scene %.100s", base_name(description->path));
}

clt_status clt_scene_appearance(const clt_scene *scene, const clt_image *drive, clt_image *radiance, clt_error *error) {
  const clt_scene_description *description = &scene->description;
  size_t cells = (size_t)description->width * (size_t)description->height;
  if (drive->width != description->width || drive->height != description->height ||
      drive->channels != description->channels) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the drive is %d x %d with %d channels, but the scene's grid is %d x %d with %d", drive->width,
                    drive->height, drive->channels, description->width, description->height, description->channels);
  }
  size_t values = cells * (size_t)description->channels;
  double *x = clt_alloc(2 * cells, sizeof *x), *y = x + cells;
  float *shown = clt_alloc(3 * values, sizeof *shown), *scratch = shown + values;
  clt_status status = x != NULL && shown != NULL ? clt_image_init(radiance, description->channels, description->height,
                                                                  description->width, error)
                                                 : out_of_memory(scene, error);
  if (status == CLT_OK) {
    memcpy(shown, drive->data, values * sizeof *shown);
    clt_plan_drive(&scene->plan, shown, scratch);
  }
  for (int c = 0; c < description->channels && status == CLT_OK; c++) {
    const float *black = clt_transport_black(scene->transport, c);
    for (size_t j = 0; j < cells; j++) {
      x[j] = (double)shown[(size_t)c * cells + j];
    }
    clt_transport_apply(scene->transport, c, x, y);
    for (size_t i = 0; i < cells; i++) {
      radiance->data[(size_t)c * cells + i] = (float)((double)black[i] + y[i]);
    }
  }
  if (status == CLT_OK) {
    clt_plan_radiance(&scene->plan, radiance->data, scratch);
  }
  free(x);
  free(shown);
  return status;
}
