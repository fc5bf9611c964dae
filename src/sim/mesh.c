#include "sim/mesh.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* How each surface is divided: columns x rows elements from number first on, before the lit ones are put last. A
 * triangle has as many columns as rows: row r holds columns - r upright triangles with turned ones between them. */
typedef struct division {
  int columns, rows, first;
  bool triangle;
} division;

static void trace(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility) {
  clt_vector from = description->projector.pinhole.position;
#pragma omp parallel for schedule(static)
  for (int cell = 0; cell < mesh->cells; cell++) {
    clt_ray_end *ends = &mesh->ends[(size_t)cell * mesh->rays];
    double total = 0.0;
    for (int ray = 0; ray < mesh->rays; ray++) {
      clt_vector direction = clt_scene_ray(description, cell, ray, &ends[ray].share);
      clt_hit hit = clt_visibility_first_hit(visibility, from, direction, -1);
      total += ends[ray].share;
      ends[ray].surface = hit.front ? hit.surface : -1;
      if (ends[ray].surface >= 0) {
        double length = vec_length(direction), distance = hit.distance * length;
        double cosine = -vec_dot(direction, description->surfaces[hit.surface].normal) / length;
        ends[ray].falloff = cosine / (distance * distance);
        ends[ray].s = hit.s;
        ends[ray].t = hit.t;
      }
    }
    for (int ray = 0; ray < mesh->rays; ray++) {
      ends[ray].share /= total;
    }
    mesh->solid_angle[cell] = total;
  }
}

static int compare(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/* Median over lit cells of the area that a cell's solid angle covers: omega r^2 / cos. scratch: cells values. */
static double median_footprint(const clt_mesh *mesh, double *scratch) {
  int lit = 0;
  for (int cell = 0; cell < mesh->cells; cell++) {
    double area = 0.0, share = 0.0;
    for (int ray = 0; ray < mesh->rays; ray++) {
      const clt_ray_end *end = &mesh->ends[(size_t)cell * mesh->rays + ray];
      if (end->surface >= 0) {
        area += end->share * mesh->solid_angle[cell] / end->falloff;
        share += end->share;
      }
    }
    if (share > 0.0) {
      scratch[lit++] = area / share;
    }
  }
  qsort(scratch, (size_t)lit, sizeof *scratch, compare);
  return scratch[lit / 2];
}

static int divide(const clt_scene_description *description, double side, division *divisions) {
  int count = 0;
  for (int k = 0; k < description->surface_count; k++) {
    const clt_rectangle *surface = &description->surfaces[k];
    double columns = fmin(fmax(1.0, ceil(vec_length(surface->u) / side - 1e-9)), CLT_ELEMENTS_MAX);
    double rows = fmin(fmax(1.0, ceil(vec_length(surface->v) / side - 1e-9)), CLT_ELEMENTS_MAX);
    if (surface->triangle) {
      columns = rows = fmax(columns, rows);
    }
    divisions[k] = (division){(int)columns, (int)rows, count, surface->triangle};
    count = columns * rows + count > CLT_ELEMENTS_MAX ? CLT_ELEMENTS_MAX + 1 : count + (int)(columns * rows);
  }
  return count;
}

/* Divides the surfaces; returns the number of elements. */
static int choose_division(const clt_scene_description *description, double footprint, division *divisions) {
  double area = 0.0;
  for (int k = 0; k < description->surface_count; k++) {
    area += clt_rectangle_area(&description->surfaces[k]);
  }
  double side = sqrt(fmin(footprint, area / CLT_ELEMENTS_WANTED));
  int count = divide(description, side, divisions);
  while (count > CLT_ELEMENTS_MAX) {
    side *= 1.02;
    count = divide(description, side, divisions);
  }
  return count;
}

/* The number of a triangle's first element in row `row`. */
static int row_start(const division *of, int row) {
  return row * (2 * of->columns - row);
}

static int element_at(const division *of, double s, double t) {
  double x = fmax(s, 0.0) * of->columns, y = fmax(t, 0.0) * of->rows;
  int row = (int)fmin(y, of->rows - 1);
  if (!of->triangle) {
    return of->first + row * of->columns + (int)fmin(x, of->columns - 1);
  }
  int last = of->columns - 1 - row, column = (int)fmin(x, last);
  bool turned = column < last && (x - column) + (y - row) > 1.0;
  return of->first + row_start(of, row) + 2 * column + turned;
}

/* Element number `number` of a surface, counted from its first. */
static clt_rectangle part_of(const clt_rectangle *whole, const division *by, int number) {
  clt_rectangle part = *whole;
  part.u = vec_scale(1.0 / by->columns, whole->u);
  part.v = vec_scale(1.0 / by->rows, whole->v);
  int row = number / by->columns, column = number % by->columns;
  if (by->triangle) {
    for (row = 0; row_start(by, row + 1) <= number;) {
      row++;
    }
    bool turned = (number - row_start(by, row)) % 2 != 0;
    column = (number - row_start(by, row)) / 2 + turned;
    row += turned;
    if (turned) {
      part.u = vec_scale(-1.0, part.u);
      part.v = vec_scale(-1.0, part.v);
    }
  }
  part.corner = vec_along(whole->corner, column / (double)by->columns, whole->u, row / (double)by->rows, whole->v);
  return part;
}

/* Numbers the elements: place[old] = new, lit ones last. */
static void order_elements(clt_mesh *mesh, const division *divisions, int *place) {
  memset(place, 0, (size_t)mesh->count * sizeof *place);
  for (size_t k = 0; k < (size_t)mesh->cells * (size_t)mesh->rays; k++) {
    clt_ray_end *end = &mesh->ends[k];
    end->element = end->surface >= 0 ? element_at(&divisions[end->surface], end->s, end->t) : -1;
    if (end->element >= 0) {
      mesh->lit += place[end->element] == 0;
      place[end->element] = 1;
    }
  }
  int unlit = 0, lit = mesh->count - mesh->lit;
  for (int k = 0; k < mesh->count; k++) {
    place[k] = place[k] != 0 ? lit++ : unlit++;
  }
  for (size_t k = 0; k < (size_t)mesh->cells * (size_t)mesh->rays; k++) {
    if (mesh->ends[k].element >= 0) {
      mesh->ends[k].element = place[mesh->ends[k].element];
    }
  }
}

static void place_elements(clt_mesh *mesh, const clt_scene_description *description, const division *divisions,
                           const int *place) {
  for (int k = 0; k < description->surface_count; k++) {
    const clt_rectangle *whole = &description->surfaces[k];
    const division *by = &divisions[k];
    for (int e = 0; e < by->columns * by->rows; e++) {
      mesh->elements[place[by->first + e]] = part_of(whole, by, e);
      mesh->surface[place[by->first + e]] = k;
    }
  }
}

/* Sums the sub-rays of each cell by element. */
static void gather_weights(clt_mesh *mesh) {
  int used = 0;
  for (int cell = 0; cell < mesh->cells; cell++) {
    int first = mesh->start[cell] = used;
    for (int ray = 0; ray < mesh->rays; ray++) {
      const clt_ray_end *end = &mesh->ends[(size_t)cell * mesh->rays + ray];
      if (end->surface < 0) {
        continue;
      }
      int k = first;
      while (k < used && mesh->element[k] != end->element) {
        k++;
      }
      if (k == used) {
        mesh->element[used++] = end->element;
        mesh->weight[k] = 0.0;
      }
      mesh->weight[k] += end->share;
    }
  }
  mesh->start[mesh->cells] = used;
}

static clt_status out_of_memory(const clt_scene_description *description, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s: out of memory for the light's mesh; use a smaller grid", description->path);
}

clt_status clt_mesh_init(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility,
                         clt_error *error) {
  mesh->cells = description->width * description->height;
  mesh->rays = description->rays * description->rays;
  size_t cells = (size_t)mesh->cells, ends = cells * (size_t)mesh->rays;
  mesh->ends = clt_alloc(ends, sizeof *mesh->ends);
  mesh->solid_angle = clt_alloc(cells, sizeof *mesh->solid_angle);
  mesh->start = clt_alloc(cells + 1, sizeof *mesh->start);
  mesh->element = clt_alloc(ends, sizeof *mesh->element);
  mesh->weight = clt_alloc(ends, sizeof *mesh->weight);
  if (!mesh->ends || !mesh->solid_angle || !mesh->start || !mesh->element || !mesh->weight) {
    return out_of_memory(description, error);
  }
  trace(mesh, description, visibility);
  division divisions[CLT_SURFACES_MAX];
  mesh->count = choose_division(description, median_footprint(mesh, mesh->weight), divisions);
  mesh->elements = clt_alloc((size_t)mesh->count, sizeof *mesh->elements);
  mesh->surface = clt_alloc((size_t)mesh->count, sizeof *mesh->surface);
  int *place = clt_alloc((size_t)mesh->count, sizeof *place);
  if (!mesh->elements || !mesh->surface || !place) {
    free(place);
    return out_of_memory(description, error);
  }
  order_elements(mesh, divisions, place);
  place_elements(mesh, description, divisions, place);
  gather_weights(mesh);
  free(place);
  return CLT_OK;
}

void clt_mesh_finish(clt_mesh *mesh) {
  free(mesh->elements);
  free(mesh->surface);
  free(mesh->ends);
  free(mesh->solid_angle);
  free(mesh->start);
  free(mesh->element);
  free(mesh->weight);
  *mesh = (clt_mesh){0};
}
