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

static void widen(clt_shown_part *part, int column, int row) {
  part->first_column = column < part->first_column ? column : part->first_column;
  part->last_column = column > part->last_column ? column : part->last_column;
  part->first_row = row < part->first_row ? row : part->first_row;
  part->last_row = row > part->last_row ? row : part->last_row;
}

static void find_parts(clt_shown *shown) {
  for (int k = 0; k <= shown->surfaces; k++) {
    shown->part[k] = (clt_shown_part){shown->width, -1, shown->height, -1};
  }
  for (int cell = 0; cell < shown->width * shown->height; cell++) {
    if (shown->surface[cell] >= 0) {
      widen(&shown->part[shown->surface[cell]], cell % shown->width, cell / shown->width);
      widen(&shown->part[shown->surfaces], cell % shown->width, cell / shown->width);
    }
  }
}

clt_status clt_shown_init(clt_shown *shown, const clt_scene_description *description, const clt_visibility *visibility,
                          clt_error *error) {
  int cells = description->width * description->height, rays = description->rays * description->rays;
  *shown = (clt_shown){.width = description->width,
                       .height = description->height,
                       .surfaces = description->surface_count,
                       .surface = clt_alloc((size_t)cells, sizeof *shown->surface),
                       .part = clt_alloc((size_t)description->surface_count + 1, sizeof *shown->part)};
  if (shown->surface == NULL || shown->part == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for what %d cells show", description->path, cells);
  }
#pragma omp parallel for schedule(static)
  for (int cell = 0; cell < cells; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    clt_cell_trace(description, visibility, cell, ends);
    shown->surface[cell] = most_seen(ends, rays);
  }
  find_parts(shown);
  return CLT_OK;
}

void clt_shown_finish(clt_shown *shown) {
  free(shown->surface);
  free(shown->part);
  *shown = (clt_shown){0};
}

static int larger(int a, int b) {
  return a > b ? a : b;
}

static int smaller(int a, int b) {
  return a < b ? a : b;
}

/* A search for the nearest cell that shows a surface (-1: any). */
typedef struct search {
  const clt_shown *shown;
  const clt_shown_part *part;
  int surface, column, row;
  int best, nearest; /* the cell found, and its squared distance */
} search;

/* Tries the cell so far to the right and down. */
static void try_cell(search *s, int right, int down) {
  int column = s->column + right, row = s->row + down, distance = right * right + down * down;
  if (column < s->part->first_column || column > s->part->last_column || distance >= s->nearest) {
    return;
  }
  int cell = row * s->shown->width + column, found = s->shown->surface[cell];
  if (found >= 0 && (s->surface < 0 || found == s->surface)) {
    s->nearest = distance;
    s->best = cell;
  }
}

/* Tries the cells of the part on the square ring that lies so many cells around. */
static void try_ring(search *s, int ring) {
  int top = larger(-ring, s->part->first_row - s->row), bottom = smaller(ring, s->part->last_row - s->row);
  for (int down = top; down <= bottom; down++) {
    if (abs(down) < ring) {
      try_cell(s, -ring, down);
      try_cell(s, ring, down);
      continue;
    }
    int left = larger(-ring, s->part->first_column - s->column);
    for (int right = left; right <= smaller(ring, s->part->last_column - s->column); right++) {
      try_cell(s, right, down);
    }
  }
}

int clt_shown_nearest(const clt_shown *shown, int surface, int column, int row) {
  bool any = shown->part[surface].first_row > shown->part[surface].last_row;
  const clt_shown_part *part = &shown->part[any ? shown->surfaces : surface];
  search s = {shown, part, any ? -1 : surface, column, row, -1, INT_MAX};
  int aside = larger(part->first_column - column, column - part->last_column);
  int ring = larger(0, larger(aside, larger(part->first_row - row, row - part->last_row)));
  for (int rings = larger(shown->width, shown->height); ring < rings && ring * ring < s.nearest; ring++) {
    try_ring(&s, ring);
  }
  return s.best;
}
