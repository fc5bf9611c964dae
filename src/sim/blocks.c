#include "sim/blocks.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/shaft.h"
#include "sim/sides.h"

/* Where the error of an interpolation is looked at: Chebyshev polynomials of even order are +-1 at all of -1, 0, 1, and
 * those of odd order at the ends. */
enum { PROBES_SIDE = 3, PROBES = PROBES_SIDE * PROBES_SIDE };
/* Segments that say what passes between two clusters. */
enum { SEGMENTS = 16 };
/* Surfaces up to which each pair is asked which others may stand between; of more, rays tell. */
enum { CULLED_MAX = 256 };
enum { ANY_SURFACE = -1 };
/* Clusters of up to so many elements exchange element by element where they touch, or are apart but too close: sooner
 * done than with all the smaller blocks that they would be parted into. */
enum { TOUCHING_MAX = 128, APART_MAX = 48 };

typedef enum verdict { NOTHING, INTERPOLATED, ELEMENTS, PART_A, PART_B } verdict;

typedef struct pair {
  clt_block block;
  verdict verdict;
} pair;

/* Pairs to be judged, and the surfaces that may stand between them. */
typedef struct generation {
  size_t count, room;
  pair *pair;
  size_t blocker_count, blocker_room;
  int *blocker;
} generation;

typedef struct builder {
  const clt_parts *parts;
  const clt_clusters *clusters;
  clt_accuracy accuracy;
  double probe[PROBES][2];
  double node[CLT_ORDER_MAX + 1][CLT_NODES][2];         /* of each order */
  double weights[CLT_ORDER_MAX + 1][PROBES][CLT_NODES]; /* of each order's nodes at the probes */
} builder;

double clt_blocks_kernel(clt_vector x, clt_vector normal_x, clt_vector y, clt_vector normal_y) {
  clt_vector way = vec_sub(y, x);
  double from = vec_dot(way, normal_x), to = -vec_dot(way, normal_y), squared = vec_dot(way, way);
  return from > 0.0 && to > 0.0 ? from * to / (M_PI * squared * squared) : 0.0;
}

static const clt_vector *normal_of(const builder *b, int cluster) {
  return &b->clusters->plane[b->clusters->cluster[cluster].surface].normal;
}

/* The kernel between places of two clusters' boxes: table[i * count + j]. */
static void tabulate(const builder *b, const clt_block *block, const double (*at)[2], int count, double *table) {
  clt_vector x[CLT_NODES], y[CLT_NODES];
  for (int k = 0; k < count; k++) {
    x[k] = clt_cluster_point(b->clusters, block->a, at[k]);
    y[k] = clt_cluster_point(b->clusters, block->b, at[k]);
  }
  for (int i = 0; i < count; i++) {
    for (int j = 0; j < count; j++) {
      table[i * count + j] = clt_blocks_kernel(x[i], *normal_of(b, block->a), y[j], *normal_of(b, block->b));
    }
  }
}

/* The largest error of an order's interpolation at the probes, where the kernel is `truth`. */
static double interpolation_error(const builder *b, const clt_block *block, int order, const double *truth) {
  int nodes = order * order;
  double table[CLT_NODES * CLT_NODES], half[CLT_NODES], worst = 0.0;
  tabulate(b, block, b->node[order], nodes, table);
  for (int p = 0; p < PROBES; p++) {
    for (int j = 0; j < nodes; j++) {
      half[j] = 0.0;
      for (int i = 0; i < nodes; i++) {
        half[j] += b->weights[order][p][i] * table[i * nodes + j];
      }
    }
    for (int q = 0; q < PROBES; q++) {
      double sum = 0.0;
      for (int j = 0; j < nodes; j++) {
        sum += b->weights[order][q][j] * half[j];
      }
      worst = fmax(worst, fabs(sum - truth[p * PROBES + q]));
    }
  }
  return worst;
}

/* How far a point is from a cluster's box. */
static double distance_to(const clt_clusters *clusters, int number, clt_vector point) {
  const clt_cluster *cluster = &clusters->cluster[number];
  const clt_plane *plane = &clusters->plane[cluster->surface];
  clt_vector from = vec_sub(point, plane->origin);
  double squared = pow(vec_dot(from, plane->normal), 2.0);
  for (int axis = 0; axis < 2; axis++) {
    double at = vec_dot(from, plane->along[axis]);
    double off = fmax(0.0, fmax(cluster->low[axis] - at, at - cluster->high[axis]));
    squared += off * off;
  }
  return sqrt(squared);
}

static double radius(const clt_cluster *cluster) {
  return 0.5 * hypot(cluster->high[0] - cluster->low[0], cluster->high[1] - cluster->low[1]);
}

/* True where the clusters are so far from each other that probes at corners and middles see what the kernel does. */
static bool well_apart(const clt_clusters *clusters, int a, int b) {
  const double least = 0.4; /* of the longer side */
  const double centre[2] = {0.0, 0.0};
  const clt_cluster *of_a = &clusters->cluster[a], *of_b = &clusters->cluster[b];
  double from_a = distance_to(clusters, a, clt_cluster_point(clusters, b, centre)) - radius(of_b);
  double from_b = distance_to(clusters, b, clt_cluster_point(clusters, a, centre)) - radius(of_a);
  return fmax(from_a, from_b) >= least * fmax(clt_cluster_side(of_a), clt_cluster_side(of_b));
}

static double larger_area(const builder *b, const clt_block *block) {
  return fmax(b->clusters->cluster[block->a].area, b->clusters->cluster[block->b].area);
}

/* Sets the least order that keeps the wanted error, and its value where that is 1; false where none does. */
static bool interpolate(const builder *b, clt_block *block, const double *truth) {
  const double floor = 1e-3;
  double mean = 0.0, error = INFINITY;
  for (int k = 0; k < PROBES * PROBES; k++) {
    mean += truth[k] / (PROBES * PROBES);
  }
  double allowed = b->accuracy.kernel * (mean + floor / larger_area(b, block));
  for (int order = 1; order <= CLT_ORDER_MAX && error > allowed; order++) {
    block->order = order;
    error = interpolation_error(b, block, order, truth);
  }
  return error <= allowed;
}

static double fraction(double x) {
  return x - floor(x);
}

/* A point of the cluster that u, v in 0..1 choose evenly by its area, if its elements are equally large. */
static clt_vector point_of(const builder *b, int number, double u, double v, int *element) {
  const clt_cluster *cluster = &b->clusters->cluster[number];
  int held = cluster->end - cluster->begin, k = (int)(u * held);
  *element = b->clusters->order[cluster->begin + k];
  return clt_rectangle_point(&b->parts->elements[*element], fraction(u * held), v);
}

/* The mean of the kernel over both clusters with what stands between, by segments between points of Roberts' R4
 * sequence, begun elsewhere for every pair. Counts the open ones. */
static double mean_passing(const builder *b, const clt_block *block, int *open) {
  const double step[4] = {0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101};
  const clt_clusters *clusters = b->clusters;
  double begin = fraction(0.7548776662466927 * block->a + 0.5698402909980532 * block->b), sum = 0.0;
  *open = 0;
  for (int k = 0; k < SEGMENTS; k++) {
    double at[4];
    int from, to;
    for (int d = 0; d < 4; d++) {
      at[d] = fraction((d + 1) * begin + k * step[d]);
    }
    clt_vector x = point_of(b, block->a, at[0], at[1], &from), y = point_of(b, block->b, at[2], at[3], &to);
    int surface_a = clusters->cluster[block->a].surface, surface_b = clusters->cluster[block->b].surface;
    if (!clt_visibility_blocked(b->parts->visibility, x, y, surface_a, surface_b)) {
      (*open)++;
      sum += clt_blocks_kernel(x, *normal_of(b, block->a), y, *normal_of(b, block->b)) / SEGMENTS;
    }
  }
  return sum;
}

/* Keeps those of the blockers that may stand between; true where one closes the way. */
static bool cull(const builder *b, clt_block *block, int *blockers) {
  clt_vector corners_a[4], corners_b[4];
  clt_shaft shaft;
  int kept = 0;
  clt_cluster_corners(b->clusters, block->a, corners_a);
  clt_cluster_corners(b->clusters, block->b, corners_b);
  clt_shaft_init(&shaft, corners_a, *normal_of(b, block->a), corners_b, *normal_of(b, block->b));
  for (int k = 0; k < block->blockers; k++) {
    const clt_rectangle *surface = &b->parts->surfaces[blockers[k]];
    if (clt_shaft_may_hold(&shaft, surface)) {
      if (clt_shaft_closed_by(&shaft, surface)) {
        return true;
      }
      blockers[kept++] = blockers[k];
    }
  }
  block->blockers = block->blockers == ANY_SURFACE ? ANY_SURFACE : kept;
  return false;
}

/* The half of a pair that is to be parted: the longer one that can be, or ELEMENTS. */
static verdict part_longer(const builder *b, const clt_block *block) {
  const clt_cluster *of_a = &b->clusters->cluster[block->a], *of_b = &b->clusters->cluster[block->b];
  if (of_a->child < 0 && of_b->child < 0) {
    return ELEMENTS;
  }
  bool a_longer = clt_cluster_side(of_a) >= clt_cluster_side(of_b);
  return of_b->child < 0 || (a_longer && of_a->child >= 0) ? PART_A : PART_B;
}

/* What to do with a pair that something may part; sets *open where it turns out to be open. */
static verdict judge_parted(const builder *b, clt_block *block, double most, bool *open) {
  int passed = SEGMENTS;
  *open = false;
  if (most * larger_area(b, block) > b->accuracy.rest) {
    return part_longer(b, block);
  }
  block->order = 1;
  block->value = (float)mean_passing(b, block, &passed);
  *open = passed == SEGMENTS;
  return passed > 0 ? INTERPOLATED : NOTHING;
}

static verdict judge_open(const builder *b, clt_block *block, const double *truth) {
  const clt_cluster *of_a = &b->clusters->cluster[block->a], *of_b = &b->clusters->cluster[block->b];
  double pairs = (double)(of_a->end - of_a->begin) * (of_b->end - of_b->begin);
  if (!well_apart(b->clusters, block->a, block->b)) {
    return pairs <= TOUCHING_MAX * TOUCHING_MAX ? ELEMENTS : part_longer(b, block);
  }
  if (interpolate(b, block, truth)) {
    const double centre[2] = {0.0, 0.0};
    clt_vector x = clt_cluster_point(b->clusters, block->a, centre);
    clt_vector y = clt_cluster_point(b->clusters, block->b, centre);
    block->value = (float)clt_blocks_kernel(x, *normal_of(b, block->a), y, *normal_of(b, block->b));
    return INTERPOLATED;
  }
  verdict nearer = pairs <= APART_MAX * APART_MAX ? ELEMENTS : part_longer(b, block);
  double rest = interpolation_error(b, block, CLT_ORDER_MAX, truth) * larger_area(b, block);
  return nearer == ELEMENTS && rest <= b->accuracy.rest ? INTERPOLATED : nearer;
}

static verdict judge(const builder *b, clt_block *block, int *blockers) {
  double truth[PROBES * PROBES], most = 0.0;
  tabulate(b, block, b->probe, PROBES, truth);
  for (int k = 0; k < PROBES * PROBES; k++) {
    most = fmax(most, truth[k]);
  }
  if (most == 0.0 || cull(b, block, blockers)) {
    return NOTHING;
  }
  bool open = block->blockers == 0;
  verdict found = open ? NOTHING : judge_parted(b, block, most, &open);
  if (!open) {
    block->order = found == ELEMENTS ? CLT_BLOCK_NEAR : block->order;
    return found;
  }
  found = judge_open(b, block, truth);
  block->order = found == ELEMENTS ? CLT_BLOCK_NEAR : block->order;
  return found;
}

/* Makes room for more of something; false where memory is short. */
static bool make_room(void **items, size_t *room, size_t wanted, size_t size) {
  if (wanted <= *room) {
    return true;
  }
  size_t larger = wanted > 2 * *room ? wanted : 2 * *room;
  void *moved = realloc(*items, larger * size);
  if (moved == NULL) {
    return false;
  }
  *items = moved;
  *room = larger;
  return true;
}

static bool keep_blockers(int **to, size_t *count, size_t *room, const int *from, clt_block *block) {
  size_t more = block->blockers > 0 ? (size_t)block->blockers : 0;
  void *items = *to;
  if (!make_room(&items, room, *count + more, sizeof **to)) {
    return false;
  }
  *to = items;
  if (more > 0) {
    memcpy(&(*to)[*count], from, more * sizeof *from);
  }
  block->first_blocker = (int)*count;
  *count += more;
  return true;
}

static bool add_pair(generation *to, clt_block block, const int *blockers) {
  void *items = to->pair;
  if (!make_room(&items, &to->room, to->count + 1, sizeof *to->pair)) {
    return false;
  }
  to->pair = items;
  if (!keep_blockers(&to->blocker, &to->blocker_count, &to->blocker_room, blockers, &block)) {
    return false;
  }
  to->pair[to->count++] = (pair){.block = block};
  return true;
}

static void free_generation(generation *of) {
  free(of->pair);
  free(of->blocker);
}

/* Every pair of surfaces that face each other; where some surface may stand between, each may until it is asked. */
static bool first_generation(const builder *b, const clt_sides *sides, generation *to) {
  const clt_parts *parts = b->parts;
  bool few = parts->surface_count <= CULLED_MAX, enough = true;
  int others[CULLED_MAX];
  for (int s = 0; s < parts->surface_count && enough; s++) {
    for (int t = s + 1; t < parts->surface_count && enough; t++) {
      bool parted = clt_sides_may_be_parted(sides, s, t, s, t);
      clt_block block = {.a = b->clusters->root[s], .b = b->clusters->root[t]};
      block.blockers = parted && !few ? ANY_SURFACE : 0;
      if (block.a < 0 || block.b < 0 || !clt_rectangles_face(&parts->surfaces[s], &parts->surfaces[t])) {
        continue;
      }
      for (int k = 0; k < parts->surface_count && parted && few; k++) {
        if (k != s && k != t) {
          others[block.blockers++] = k;
        }
      }
      enough = add_pair(to, block, others);
    }
  }
  return enough;
}

static bool append(clt_blocks *blocks, const clt_block *block) {
  void *items = blocks->block;
  if (!make_room(&items, &blocks->room, blocks->count + 1, sizeof *blocks->block)) {
    return false;
  }
  blocks->block = items;
  blocks->block[blocks->count++] = *block;
  return true;
}

static bool keep_block(clt_blocks *blocks, const clt_block *block, const int *blockers) {
  clt_block kept = *block;
  if (kept.order != CLT_BLOCK_NEAR) {
    kept.blockers = 0;
  }
  return keep_blockers(&blocks->blocker, &blocks->blocker_count, &blocks->blocker_room, blockers, &kept) &&
         append(blocks, &kept);
}

/* Keeps what was judged to be a block, and hands the halves of what is to be parted on. */
static bool sort_out(const builder *b, const generation *judged, clt_blocks *blocks, generation *next) {
  bool enough = true;
  for (size_t k = 0; k < judged->count && enough; k++) {
    const pair *of = &judged->pair[k];
    const int *blockers = &judged->blocker[of->block.first_blocker];
    clt_block half = of->block;
    if (of->verdict == INTERPOLATED || of->verdict == ELEMENTS) {
      enough = keep_block(blocks, &of->block, blockers);
    } else if (of->verdict != NOTHING) {
      int *parted = of->verdict == PART_A ? &half.a : &half.b;
      *parted = b->clusters->cluster[*parted].child;
      enough = add_pair(next, half, blockers);
      (*parted)++;
      enough = enough && add_pair(next, half, blockers);
    }
  }
  return enough;
}

static void judge_all(const builder *b, generation *of) {
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t k = 0; k < of->count; k++) {
    clt_block *block = &of->pair[k].block;
    of->pair[k].verdict = judge(b, block, &of->blocker[block->first_blocker]);
  }
}

static void set_places(builder *b) {
  for (int order = 1; order <= CLT_ORDER_MAX; order++) {
    for (int k = 0; k < order * order; k++) {
      b->node[order][k][0] = clt_interpolation_node(order, k / order);
      b->node[order][k][1] = clt_interpolation_node(order, k % order);
    }
  }
  for (int k = 0; k < PROBES; k++) {
    b->probe[k][0] = k / PROBES_SIDE - 1.0;
    b->probe[k][1] = k % PROBES_SIDE - 1.0;
    for (int order = 1; order <= CLT_ORDER_MAX; order++) {
      clt_interpolation_plane(order, b->probe[k], b->weights[order][k]);
    }
  }
}

static clt_status out_of_memory(const clt_clusters *clusters, clt_error *error) {
  return clt_fail(error, CLT_FAILED,
                  "out of memory for the exchange of light between %d surface elements; use a "
                  "smaller grid",
                  clusters->elements);
}

clt_status clt_blocks_init(clt_blocks *blocks, const clt_parts *parts, const clt_clusters *clusters,
                           const clt_accuracy *accuracy, clt_error *error) {
  builder b = {.parts = parts, .clusters = clusters, .accuracy = *accuracy};
  generation now = {.count = 0};
  clt_sides *sides = NULL;
  clt_status status =
      clt_sides_create(parts->surfaces, parts->surface_count, parts->surfaces, parts->surface_count, &sides, error);
  if (status != CLT_OK) {
    return status;
  }
  set_places(&b);
  bool enough = first_generation(&b, sides, &now);
  clt_sides_destroy(sides);
  while (enough && now.count > 0) {
    generation next = {.count = 0};
    judge_all(&b, &now);
    enough = sort_out(&b, &now, blocks, &next);
    free_generation(&now);
    now = next;
  }
  free_generation(&now);
  return enough ? CLT_OK : out_of_memory(clusters, error);
}

clt_status clt_blocks_part_near(clt_blocks *blocks, const clt_clusters *clusters, clt_error *error) {
  for (size_t k = 0; k < blocks->count; k++) {
    clt_block half = blocks->block[k];
    while (half.order == CLT_BLOCK_NEAR) {
      int a = clusters->cluster[half.a].child, b = clusters->cluster[half.b].child;
      if (a < 0 && b < 0) {
        break;
      }
      clt_block other = half;
      if (a >= 0) {
        half.a = a;
        other.a = a + 1;
      } else {
        half.b = b;
        other.b = b + 1;
      }
      if (!append(blocks, &other)) {
        return out_of_memory(clusters, error);
      }
    }
    blocks->block[k] = half;
  }
  return CLT_OK;
}

void clt_blocks_finish(clt_blocks *blocks) {
  free(blocks->block);
  free(blocks->blocker);
  *blocks = (clt_blocks){0};
}
