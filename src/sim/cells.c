#include "sim/cells.h"

#include <stdlib.h>

#include "base/memory.h"

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
    }
  }
  for (int ray = 0; ray < rays; ray++) {
    ends[ray].share /= total;
  }
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

static double direct_light(const clt_scene_description *description, int channel, const clt_ray_end *ends) {
  double sum = 0.0;
  for (int ray = 0; ray < description->rays * description->rays; ray++) {
    if (ends[ray].surface >= 0) {
      sum += ends[ray].share * ends[ray].falloff * description->surfaces[ends[ray].surface].albedo[channel];
    }
  }
  return sum * description->projector.intensity[channel] / M_PI;
}

static void mark_lit(clt_cells *cells, const clt_ray_end *ends, int rays) {
  for (int ray = 0; ray < rays; ray++) {
    if (ends[ray].surface >= 0) {
#pragma omp atomic write
      cells->lit[ends[ray].surface] = true;
    }
  }
}

/* footprints: count values. */
static void trace_all(clt_cells *cells, const clt_scene_description *description, const clt_visibility *visibility,
                      double *footprints) {
  int rays = description->rays * description->rays;
#pragma omp parallel for schedule(static)
  for (int cell = 0; cell < cells->count; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    cells->solid_angle[cell] = clt_cell_trace(description, visibility, cell, ends);
    footprints[cell] = footprint_of(ends, rays, cells->solid_angle[cell]);
    mark_lit(cells, ends, rays);
    for (int c = 0; c < cells->channels; c++) {
      cells->direct[(size_t)c * (size_t)cells->count + (size_t)cell] = direct_light(description, c, ends);
    }
  }
}

static int compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Median of the positive values, which are moved to the front. */
static double median_positive(double *values, int count) {
  int lit = 0;
  for (int k = 0; k < count; k++) {
    if (values[k] > 0.0) {
      values[lit++] = values[k];
    }
  }
  qsort(values, (size_t)lit, sizeof *values, compare);
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
  if (!footprints || !cells->solid_angle || !cells->direct || !cells->lit) {
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
  *cells = (clt_cells){0};
}
