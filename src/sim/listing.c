#include "sim/listing.h"

#include <stdlib.h>

#include "base/memory.h"
#include "sim/gloss.h"

/* Cells whose lists are made together; rays that the lobes of a cell send out, at most and in all cells together. */
enum { BLOCK = 64, LOBE_RAYS_MAX = 1024, LOBE_RAYS_ALL = 1 << 22 };

/* A row on its way: its elements in the order in which they were met, with a weight in each plane. */
typedef struct tally {
  int *slot; /* of each element: 1 + its number in the row, or 0 */
  int used;
  int element[LOBE_RAYS_MAX];
  double weight[CLT_SIM_CHANNELS_MAX][LOBE_RAYS_MAX];
} tally;

static void add(tally *row, int element, const double *weights, int planes) {
  if (row->slot[element] == 0) {
    row->element[row->used] = element;
    for (int p = 0; p < planes; p++) {
      row->weight[p][row->used] = 0.0;
    }
    row->slot[element] = ++row->used;
  }
  for (int p = 0; p < planes; p++) {
    row->weight[p][row->slot[element] - 1] += weights[p];
  }
}

/* Ends the row and appends it to the lists, one for each plane. */
static bool append(tally *row, clt_weights *lists, int planes) {
  bool enough = true;
  for (int p = 0; p < planes && enough; p++) {
    enough = clt_weights_append(&lists[p], row->element, row->weight[p], row->used);
  }
  for (int k = 0; k < row->used; k++) {
    row->slot[row->element[k]] = 0;
  }
  row->used = 0;
  return enough;
}

static void tally_hit(const clt_listing *listing, tally *row, const clt_hit *hit, const double *weights, int planes) {
  const clt_division *by = hit->surface >= 0 ? &listing->divisions[hit->surface] : NULL;
  if (by != NULL && hit->front && by->columns > 0) {
    add(row, clt_division_element(by, hit->s, hit->t), weights, planes);
  }
}

/* What the cell lights, or sees. */
static void tally_ends(const clt_listing *listing, tally *row, const clt_ray_end *ends, bool view) {
  for (int ray = 0; ray < listing->description->rays * listing->description->rays; ray++) {
    double weight = view ? ends[ray].view : ends[ray].share;
    clt_hit hit = {.surface = ends[ray].surface, .front = true, .s = ends[ray].s, .t = ends[ray].t};
    if (weight > 0.0) {
      tally_hit(listing, row, &hit, &weight, 1);
    }
  }
}

static double fraction(double x) {
  return x - floor(x);
}

/* Rays that each end sends out. */
static int rays_per_end(const clt_listing *listing) {
  const clt_scene_description *description = listing->description;
  int cells = description->width * description->height, ends = description->rays * description->rays;
  int of_cell = LOBE_RAYS_ALL / cells < LOBE_RAYS_MAX ? LOBE_RAYS_ALL / cells : LOBE_RAYS_MAX;
  return of_cell > ends ? of_cell / ends : 1;
}

/* What the lobe of one end mirrors, by rays in directions that the lobe itself draws from the points first to
 * first + count of a set that covers the square evenly (Roberts' R2 sequence), begun elsewhere for every cell. */
static void tally_lobe(const clt_listing *listing, tally *row, const clt_ray_end *end, int cell, int first, int count) {
  const clt_scene_description *description = listing->description;
  const clt_rectangle *surface = &description->surfaces[end->surface];
  const clt_gloss *gloss = &description->gloss[surface->material];
  clt_vector view = vec_unit(vec_sub(clt_scene_eye(description), end->at));
  for (int k = first; k < first + count; k++) {
    clt_vector from;
    double s = fraction(0.6180339887498949 * cell + 0.7548776662466927 * (k + 1));
    double t = fraction(0.4142135623730950 * cell + 0.5698402909980532 * (k + 1));
    double weight = clt_gloss_sample(gloss->exponent, surface->normal, view, s, t, &from) * end->view / count;
    double weights[CLT_SIM_CHANNELS_MAX];
    for (int c = 0; c < CLT_SIM_CHANNELS_MAX; c++) {
      weights[c] = weight * gloss->strength[c];
    }
    if (weight > 0.0) {
      clt_hit hit = clt_visibility_first_hit(listing->visibility, end->at, from, end->surface);
      tally_hit(listing, row, &hit, weights, listing->mirror_planes);
    }
  }
}

static void tally_lobes(const clt_listing *listing, tally *row, const clt_ray_end *ends, int cell) {
  int count = rays_per_end(listing);
  for (int ray = 0; ray < listing->description->rays * listing->description->rays; ray++) {
    if (ends[ray].view > 0.0 && clt_scene_is_glossy(listing->description, ends[ray].surface)) {
      tally_lobe(listing, row, &ends[ray], cell, ray * count, count);
    }
  }
}

static bool list_cell(const clt_listing *listing, int cell, tally *row, clt_weights *lists) {
  clt_ray_end ends[CLT_CELL_RAYS_MAX];
  clt_cell_trace(listing->description, listing->visibility, cell, ends);
  tally_ends(listing, row, ends, false);
  bool enough = append(row, &lists[CLT_LIST_LIGHTS], 1);
  if (listing->sees) {
    tally_ends(listing, row, ends, true);
    enough = append(row, &lists[CLT_LIST_SEES], 1) && enough;
  }
  if (listing->mirror_planes > 0) {
    tally_lobes(listing, row, ends, cell);
    enough = append(row, &lists[CLT_LIST_MIRRORS], listing->mirror_planes) && enough;
  }
  return enough;
}

/* Whether a listing of this kind makes list number k. */
static bool makes(const clt_listing *listing, int k) {
  return k == CLT_LIST_LIGHTS || (k == CLT_LIST_SEES && listing->sees) ||
         (k >= CLT_LIST_MIRRORS && k < CLT_LIST_MIRRORS + listing->mirror_planes);
}

/* Work space of a thread. */
typedef struct bench {
  tally *row;
  clt_weights list[CLT_LISTS]; /* of one block of cells */
} bench;

static bool bench_init(bench *own, const clt_listing *listing) {
  bool enough = (own->row = clt_alloc(1, sizeof *own->row)) != NULL &&
                (own->row->slot = clt_alloc((size_t)listing->elements, sizeof *own->row->slot)) != NULL;
  for (int k = 0; k < CLT_LISTS && enough; k++) {
    enough = !makes(listing, k) || clt_weights_init(&own->list[k], BLOCK);
  }
  return enough;
}

static void bench_finish(bench *own) {
  for (int k = 0; k < CLT_LISTS; k++) {
    clt_weights_finish(&own->list[k]);
  }
  if (own->row != NULL) {
    free(own->row->slot);
  }
  free(own->row);
}

/* Moves the rows of a block to the end of the lists. */
static bool collect(clt_listing *listing, bench *own) {
  bool enough = true;
  for (int k = 0; k < CLT_LISTS && enough; k++) {
    clt_weights *from = &own->list[k];
    for (int i = 0; i < from->rows && enough; i++) {
      int count = from->start[i + 1] - from->start[i];
      const int *element = count > 0 ? &from->element[from->start[i]] : NULL; /* a block of empty rows has no arrays */
      const double *weight = count > 0 ? &from->weight[from->start[i]] : NULL;
      enough = clt_weights_append(&listing->list[k], element, weight, count);
    }
    from->rows = 0;
  }
  return enough;
}

/* Block by block, so that only a few ends are held at a time; the blocks are collected in the cells' order. */
static bool list_cells(clt_listing *listing, int cells) {
  bool enough = true;
#pragma omp parallel reduction(&& : enough)
  {
    bench own = {.row = NULL};
    enough = bench_init(&own, listing);
#pragma omp for ordered schedule(static, 1)
    for (int first = 0; first < cells; first += BLOCK) {
      int last = cells - first < BLOCK ? cells : first + BLOCK;
      for (int cell = first; cell < last && enough; cell++) {
        enough = list_cell(listing, cell, own.row, own.list);
      }
#pragma omp ordered
      enough = enough && collect(listing, &own);
    }
    bench_finish(&own);
  }
  return enough;
}

/* Planes that the gloss of the surfaces that the camera sees needs. */
static int count_planes(const clt_scene_description *description, const bool *seen) {
  int planes = 0;
  for (int k = 0; k < description->surface_count; k++) {
    const double *strength = description->gloss[description->surfaces[k].material].strength;
    for (int c = 0; c < description->channels && seen[k]; c++) {
      int needed = strength[c] != strength[0] ? description->channels : strength[c] > 0.0;
      planes = needed > planes ? needed : planes;
    }
  }
  return planes;
}

bool clt_listing_make(clt_listing *listing, const clt_cells *cells) {
  bool enough = true;
  listing->sees = listing->description->camera.placed;
  listing->mirror_planes = count_planes(listing->description, cells->seen);
  for (int k = 0; k < CLT_LISTS && enough; k++) {
    enough = !makes(listing, k) || clt_weights_init(&listing->list[k], cells->count);
  }
  return enough && list_cells(listing, cells->count);
}
