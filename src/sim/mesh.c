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

/* Elements that squares of a side give; most + 1 where that is more than `most`. */
static int divide(const clt_scene_description *description, const clt_sights *sights, double side, int most,
                  division *divisions) {
  double count = 0.0;
  for (int k = 0; k < description->surface_count; k++) {
    const clt_rectangle *surface = &description->surfaces[k];
    double columns = fmin(fmax(1.0, ceil(vec_length(surface->u) / side - 1e-9)), most);
    double rows = fmin(fmax(1.0, ceil(vec_length(surface->v) / side - 1e-9)), most);
    if (surface->triangle) {
      columns = rows = fmax(columns, rows);
    }
    if (!sights->exchange[k]) {
      columns = rows = 0.0;
    }
    divisions[k] = (division){(int)columns, (int)rows, (int)count, surface->triangle};
    count = fmin(count + columns * rows, most + 1.0);
  }
  return (int)count;
}

/* Divides the surfaces; returns the number of elements. */
static int choose_division(const clt_scene_description *description, const clt_sights *sights, double footprint,
                           clt_mesh_size size, division *divisions) {
  double area = 0.0;
  for (int k = 0; k < description->surface_count; k++) {
    area += sights->exchange[k] ? clt_rectangle_area(&description->surfaces[k]) : 0.0;
  }
  double side = sqrt(fmin(footprint, area / size.wanted));
  int count = divide(description, sights, side, size.most, divisions);
  while (count > size.most) {
    side *= 1.02;
    count = divide(description, sights, side, size.most, divisions);
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

/* place[old] = 1 for the elements of a list. */
static void mark(const clt_weights *list, int *place) {
  for (int k = 0; k < list->start[list->rows]; k++) {
    place[list->element[k]] = 1;
  }
}

static void renumber(clt_weights *list, const int *place) {
  for (int k = 0; k < list->start[list->rows]; k++) {
    list->element[k] = place[list->element[k]];
  }
}

/* Numbers the elements: place[old] = new, used ones last. place comes as zeros. */
static void order_elements(clt_mesh *mesh, int *place) {
  mark(&mesh->lights, place);
  for (int k = 0; k < mesh->count; k++) {
    mesh->used += place[k];
  }
  int unused = 0, used = mesh->count - mesh->used;
  for (int k = 0; k < mesh->count; k++) {
    place[k] = place[k] != 0 ? used++ : unused++;
  }
  renumber(&mesh->lights, place);
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

/* The lists of some cells on their way into the mesh. */
enum { BLOCK = 64 };
typedef struct block {
  int count[BLOCK]; /* entries of each cell */
  int *element;     /* CLT_CELL_RAYS_MAX of each cell */
  double *weight;
} block;

/* Sums the sub-rays of a cell by element; returns how many elements there are. */
static int gather(const clt_ray_end *ends, int rays, const division *divisions, int *element, double *weight) {
  int used = 0;
  for (int ray = 0; ray < rays; ray++) {
    const clt_ray_end *end = &ends[ray];
    if (end->surface < 0 || divisions[end->surface].columns == 0) {
      continue;
    }
    int at = element_at(&divisions[end->surface], end->s, end->t), k = 0;
    while (k < used && element[k] != at) {
      k++;
    }
    if (k == used) {
      element[used++] = at;
      weight[k] = 0.0;
    }
    weight[k] += end->share;
  }
  return used;
}

static bool append_block(clt_mesh *mesh, const block *from, int cells) {
  bool enough = true;
  for (int k = 0; k < cells && enough; k++) {
    size_t first = (size_t)k * CLT_CELL_RAYS_MAX;
    enough = clt_weights_append(&mesh->lights, &from->element[first], &from->weight[first], from->count[k]);
  }
  return enough;
}

/* Traces the cells block by block, so that only a few ends are held at a time, and keeps the lists in the cells' order.
 */
static bool list_elements(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility,
                          const division *divisions) {
  bool enough = true;
#pragma omp parallel reduction(&& : enough)
  {
    block own = {.element = clt_alloc((size_t)BLOCK * CLT_CELL_RAYS_MAX, sizeof *own.element),
                 .weight = clt_alloc((size_t)BLOCK * CLT_CELL_RAYS_MAX, sizeof *own.weight)};
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    enough = own.element != NULL && own.weight != NULL;
#pragma omp for ordered schedule(static, 1)
    for (int first = 0; first < mesh->cells; first += BLOCK) {
      int cells = mesh->cells - first < BLOCK ? mesh->cells - first : BLOCK;
      for (int k = 0; k < cells && enough; k++) {
        size_t at = (size_t)k * CLT_CELL_RAYS_MAX;
        clt_cell_trace(description, visibility, first + k, ends);
        own.count[k] =
            gather(ends, description->rays * description->rays, divisions, &own.element[at], &own.weight[at]);
      }
#pragma omp ordered
      enough = enough && append_block(mesh, &own, cells);
    }
    free(own.element);
    free(own.weight);
  }
  return enough;
}

static bool make_elements(clt_mesh *mesh, const clt_scene_description *description, const division *divisions) {
  int *place = clt_alloc((size_t)mesh->count, sizeof *place);
  mesh->elements = clt_alloc((size_t)mesh->count, sizeof *mesh->elements);
  mesh->surface = clt_alloc((size_t)mesh->count, sizeof *mesh->surface);
  bool enough = place != NULL && mesh->elements != NULL && mesh->surface != NULL;
  if (enough) {
    order_elements(mesh, place);
    place_elements(mesh, description, divisions, place);
  }
  free(place);
  return enough;
}

clt_status clt_mesh_init(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility,
                         const clt_cells *cells, const clt_sights *sights, clt_mesh_size size, clt_error *error) {
  division *divisions = clt_alloc((size_t)description->surface_count, sizeof *divisions);
  mesh->cells = cells->count;
  bool enough = divisions != NULL;
  if (enough) {
    mesh->count = choose_division(description, sights, cells->footprint, size, divisions);
    enough = clt_weights_init(&mesh->lights, mesh->cells) && list_elements(mesh, description, visibility, divisions) &&
             make_elements(mesh, description, divisions);
    mesh->sees = mesh->lights;
  }
  free(divisions);
  return enough ? CLT_OK
                : clt_fail(error, CLT_FAILED, "%s: out of memory for the light's mesh; use a smaller grid",
                           description->path);
}

void clt_mesh_finish(clt_mesh *mesh) {
  free(mesh->elements);
  free(mesh->surface);
  clt_weights_finish(&mesh->lights);
  *mesh = (clt_mesh){0};
}
