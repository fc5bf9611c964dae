#include "sim/shown.h"

#include <limits.h>
#include <stdlib.h>

#include "base/memory.h"

/* The surface with the largest share of what the camera sees. */
static int most_seen(const clt_ray_end *ends, int rays) {
  int best = -1;
  double most = 0.0;
  for (int ray = 0; ray < rays; ray++) {
    if (ends[ray].view <= 0.0 || ends[ray].surface == best) {
      continue;
    }
    double share = 0.0;
    for (int other = 0; other < rays; other++) {
      share += ends[other].surface == ends[ray].surface ? ends[other].view : 0.0;
    }
    best = share > most ? ends[ray].surface : best;
    most = fmax(most, share);
  }
  return best;
}

clt_status clt_shown_init(clt_shown *shown, const clt_scene_description *description, const clt_visibility *visibility,
                          clt_error *error) {
  int cells = description->width * description->height, rays = description->rays * description->rays;
  *shown = (clt_shown){.width = description->width,
                       .height = description->height,
                       .surface = clt_alloc((size_t)cells, sizeof *shown->surface),
                       .any = clt_alloc((size_t)description->surface_count, sizeof *shown->any)};
  if (shown->surface == NULL || shown->any == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for what %d cells show", description->path, cells);
  }
#pragma omp parallel for schedule(static)
  for (int cell = 0; cell < cells; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    clt_cell_trace(description, visibility, cell, ends);
    shown->surface[cell] = most_seen(ends, rays);
  }
  for (int cell = 0; cell < cells; cell++) {
    if (shown->surface[cell] >= 0) {
      shown->any[shown->surface[cell]] = true;
    }
  }
  return CLT_OK;
}

void clt_shown_finish(clt_shown *shown) {
  free(shown->surface);
  free(shown->any);
  *shown = (clt_shown){0};
}

/* Squared distance to a cell that serves, INT_MAX for another. */
static int distance_to(const clt_shown *shown, int surface, int column, int row, int right, int down) {
  int x = column + right, y = row + down;
  if (x < 0 || x >= shown->width || y < 0 || y >= shown->height) {
    return INT_MAX;
  }
  int found = shown->surface[y * shown->width + x];
  return found >= 0 && (surface < 0 || found == surface) ? right * right + down * down : INT_MAX;
}

int clt_shown_nearest(const clt_shown *shown, int surface, int column, int row) {
  int wanted = surface >= 0 && shown->any[surface] ? surface : -1, best = -1, nearest = INT_MAX;
  int rings = shown->width > shown->height ? shown->width : shown->height;
  for (int ring = 0; ring < rings && ring * ring < nearest; ring++) {
    for (int down = -ring; down <= ring; down++) {
      int step = abs(down) == ring || ring == 0 ? 1 : 2 * ring; /* of the rows between only the ends */
      for (int right = -ring; right <= ring; right += step) {
        int distance = distance_to(shown, wanted, column, row, right, down);
        if (distance < nearest) {
          nearest = distance;
          best = (row + down) * shown->width + column + right;
        }
      }
    }
  }
  return best;
}
