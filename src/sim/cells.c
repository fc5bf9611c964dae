#include "sim/cells.h"

#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "sim/gloss.h"

bool clt_camera_sees(const clt_scene_description *description, const clt_visibility *visibility, int surface,
                     clt_vector at) {
  const clt_pinhole *camera = &description->camera.pinhole;
  return clt_optics_covers(camera, description->camera.distortion, at) &&
         vec_dot(vec_sub(camera->position, at), description->surfaces[surface].normal) > 0.0 &&
         !clt_visibility_blocked(visibility, at, camera->position, surface, -1);
}

/* Fills in what the camera sees; without a pose of its own it sees what the projector lights. */
static void view_ends(const clt_scene_description *description, const clt_visibility *visibility, int rays,
                      clt_ray_end *ends) {
  double hidden = 0.0;
  for (int ray = 0; ray < rays; ray++) {
    bool lit = ends[ray].surface >= 0;
    bool seen = lit && (!description->camera.placed ||
                        clt_camera_sees(description, visibility, ends[ray].surface, ends[ray].at));
    ends[ray].view = seen ? ends[ray].share : 0.0;
    hidden += lit && !seen ? ends[ray].share : 0.0;
  }
  for (int ray = 0; ray < rays && hidden > 0.0; ray++) {
    ends[ray].view = ends[ray].view > 0.0 ? ends[ray].view / (1.0 - hidden) : 0.0;
  }
}

double clt_cell_trace(const clt_scene_description *description, const clt_visibility *visibility, int cell,
                      clt_ray_end *ends) {
  clt_vector from = description->projector.pinhole.position;
  int rays = description->rays * description->rays;
  double total = 0.0;
  for (int ray = 0; ray < rays; ray++) {
    clt_ray_end *end = &ends[ray];
    clt_vector direction = clt_scene_ray(description, cell, ray, &end->share);
    clt_hit hit = clt_visibility_first_hit(visibility, from, direction, -1);
    total += end->share;
    end->surface = hit.front ? hit.surface : -1;
    if (end->surface >= 0) {
      double length = vec_length(direction), distance = hit.distance * length;
      double cosine = -vec_dot(direction, description->surfaces[hit.surface].normal) / length;
      end->falloff = cosine / (distance * distance);
      end->s = hit.s;
      end->t = hit.t;
      end->at = vec_along(from, hit.distance, direction, 0.0, direction);
    }
  }
  for (int ray = 0; ray < rays; ray++) {
    ends[ray].share /= total;
  }
  view_ends(description, visibility, rays, ends);
  return total;
}

/* Area of a cell where it is lit: mean of omega r^2 / cos over the lit sub-rays; 0 where none is. */
static double footprint_of(const clt_ray_end *ends, int rays, double solid_angle) {
  double area = 0.0, share = 0.0;
  for (int ray = 0; ray < rays; ray++) {
    if (ends[ray].surface >= 0) {
      area += ends[ray].share * solid_angle / ends[ray].falloff;
      share += ends[ray].share;
    }
  }
  return share > 0.0 ? area / share : 0.0;
}

/* Strength 1 of the gloss at an end: radiance to the camera per irradiance from the projector. */
static double highlight(const clt_scene_description *description, const clt_ray_end *end) {
  const clt_rectangle *surface = &description->surfaces[end->surface];
  clt_vector light = vec_unit(vec_sub(description->projector.pinhole.position, end->at));
  clt_vector view = vec_unit(vec_sub(clt_scene_eye(description), end->at));
  return clt_gloss_lobe(description->gloss[surface->material].exponent, surface->normal, light, view);
}

/* direct comes as zeros. */
static void add_direct_light(const clt_scene_description *description, const clt_ray_end *ends, double *direct) {
  double thrown[CLT_SIM_CHANNELS_MAX] = {0.0};
  for (int ray = 0; ray < description->rays * description->rays; ray++) {
    if (ends[ray].view <= 0.0) {
      continue;
    }
    const clt_rectangle *surface = &description->surfaces[ends[ray].surface];
    double irradiance = ends[ray].view * ends[ray].falloff;
    double lobe = clt_scene_is_glossy(description, ends[ray].surface) ? highlight(description, &ends[ray]) : 0.0;
    for (int c = 0; c < description->channels; c++) {
      direct[c] += irradiance * surface->albedo[c];
      thrown[c] += irradiance * lobe * description->gloss[surface->material].strength[c];
    }
  }
  for (int c = 0; c < description->channels; c++) {
    double intensity = description->projector.intensity[c];
    direct[c] = direct[c] * intensity / M_PI + thrown[c] * intensity;
  }
}

static void mark_surfaces(clt_cells *cells, const clt_ray_end *ends, int rays) {
  for (int ray = 0; ray < rays; ray++) {
    if (ends[ray].surface >= 0) {
#pragma omp atomic write
      cells->lit[ends[ray].surface] = true;
    }
    if (ends[ray].view > 0.0) {
#pragma omp atomic write
      cells->seen[ends[ray].surface] = true;
    }
  }
}

/* How much of the cell's light the camera sees: 0 nothing, 1 a part, 2 all; 3: there is none. */
static int sight_of(const clt_ray_end *ends, int rays) {
  int lit = 0, seen = 0;
  for (int ray = 0; ray < rays; ray++) {
    lit += ends[ray].surface >= 0;
    seen += ends[ray].view > 0.0;
  }
  return lit == 0 ? 3 : seen == lit ? 2 : seen > 0;
}

/* footprints: count values. */
static void trace_all(clt_cells *cells, const clt_scene_description *description, const clt_visibility *visibility,
                      double *footprints) {
  int rays = description->rays * description->rays, hidden = 0, partly = 0;
#pragma omp parallel for schedule(static) reduction(+ : hidden, partly)
  for (int cell = 0; cell < cells->count; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    cells->solid_angle[cell] = clt_cell_trace(description, visibility, cell, ends);
    footprints[cell] = footprint_of(ends, rays, cells->solid_angle[cell]);
    double direct[CLT_SIM_CHANNELS_MAX] = {0.0};
    add_direct_light(description, ends, direct);
    mark_surfaces(cells, ends, rays);
    hidden += sight_of(ends, rays) == 0;
    partly += sight_of(ends, rays) == 1;
    for (int c = 0; c < cells->channels; c++) {
      cells->direct[(size_t)c * (size_t)cells->count + (size_t)cell] = direct[c];
    }
  }
  cells->hidden = hidden;
  cells->partly = partly;
}

/* Median of the positive values, which are moved to the front. */
static double median_positive(double *values, int count) {
  int lit = 0;
  for (int k = 0; k < count; k++) {
    if (values[k] > 0.0) {
      values[lit++] = values[k];
    }
  }
  clt_sort_doubles(values, (size_t)lit);
  return lit > 0 ? values[lit / 2] : 0.0;
}

clt_status clt_cells_init(clt_cells *cells, const clt_scene_description *description, const clt_visibility *visibility,
                          clt_error *error) {
  cells->count = description->width * description->height;
  cells->channels = description->channels;
  size_t count = (size_t)cells->count;
  double *footprints = clt_alloc(count, sizeof *footprints);
  cells->solid_angle = clt_alloc(count, sizeof *cells->solid_angle);
  cells->direct = clt_alloc(count * (size_t)cells->channels, sizeof *cells->direct);
  cells->lit = clt_alloc((size_t)description->surface_count, sizeof *cells->lit);
  cells->seen = clt_alloc((size_t)description->surface_count, sizeof *cells->seen);
  if (!footprints || !cells->solid_angle || !cells->direct || !cells->lit || !cells->seen) {
    free(footprints);
    return clt_fail(error, CLT_FAILED, "%s: out of memory for the light of %zu cells; use a smaller grid",
                    description->path, count);
  }
  trace_all(cells, description, visibility, footprints);
  cells->footprint = median_positive(footprints, cells->count);
  free(footprints);
  return CLT_OK;
}

void clt_cells_finish(clt_cells *cells) {
  free(cells->solid_angle);
  free(cells->direct);
  free(cells->lit);
  free(cells->seen);
  *cells = (clt_cells){0};
}
