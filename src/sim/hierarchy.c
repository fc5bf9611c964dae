#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/formfactor.h"
#include "sim/hierarchy_parts.h"
#include "sim/shaft.h"

/* Clusters of up to so many elements stay whole where no block needs their children. */
enum { LEAF_MAX = 512 };

/* Marks the clusters that hold a block or have a child that does. */
static void mark_needed(const clt_hierarchy *h, const clt_blocks *blocks, bool *needed) {
  for (size_t k = 0; k < blocks->count; k++) {
    needed[blocks->block[k].a] = needed[blocks->block[k].b] = true;
  }
  for (int k = h->clusters.count - 1; k >= 0; k--) {
    const clt_cluster *cluster = &h->clusters.cluster[k];
    int child = cluster->child;
    bool large = cluster->end - cluster->begin > LEAF_MAX;
    needed[k] = needed[k] || large || (child >= 0 && (needed[child] || needed[child + 1]));
  }
}

/* Drops the children that are not needed, and numbers the other clusters anew in the blocks. place: one entry for each
 * cluster. */
static void prune(clt_hierarchy *h, clt_blocks *blocks, const bool *needed, int *place) {
  clt_clusters *clusters = &h->clusters;
  int kept = 0;
  for (int k = 0; k < clusters->count; k++) { /* roots stay; a child's place was set when its parent came */
    place[k] = -1;
  }
  for (int s = 0; s < clusters->surfaces; s++) {
    if (clusters->root[s] >= 0) {
      place[clusters->root[s]] = 0;
    }
  }
  for (int k = 0; k < clusters->count; k++) {
    if (place[k] < 0) {
      continue;
    }
    clt_cluster *cluster = &clusters->cluster[k];
    if (cluster->child >= 0 && (needed[cluster->child] || needed[cluster->child + 1])) {
      place[cluster->child] = place[cluster->child + 1] = 0;
    } else {
      cluster->child = -1;
    }
    place[k] = kept;
    clusters->cluster[kept++] = *cluster;
  }
  clusters->count = kept;
  for (int k = 0; k < kept; k++) {
    clt_cluster *cluster = &clusters->cluster[k];
    cluster->child = cluster->child >= 0 ? place[cluster->child] : -1;
  }
  for (int s = 0; s < clusters->surfaces; s++) {
    clusters->root[s] = clusters->root[s] >= 0 ? place[clusters->root[s]] : -1;
  }
  for (size_t k = 0; k < blocks->count; k++) {
    blocks->block[k].a = place[blocks->block[k].a];
    blocks->block[k].b = place[blocks->block[k].b];
  }
}

static clt_status drop_unneeded(clt_hierarchy *h, clt_blocks *blocks, clt_error *error) {
  size_t count = (size_t)h->clusters.count;
  bool *needed = clt_alloc(count, sizeof *needed);
  int *place = clt_alloc(count, sizeof *place);
  bool enough = needed != NULL && place != NULL;
  if (enough) {
    mark_needed(h, blocks, needed);
    prune(h, blocks, needed, place);
  }
  free(needed);
  free(place);
  return enough ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for a tree of %zu clusters", count);
}

static clt_status out_of_memory(const clt_hierarchy *h, clt_error *error) {
  return clt_fail(error, CLT_FAILED,
                  "out of memory for the exchange of light between %d surface elements; use a "
                  "smaller grid",
                  h->clusters.elements);
}

/* Parents, levels, leaves. */
static clt_status lay_out(clt_hierarchy *h, clt_error *error) {
  size_t count = (size_t)h->clusters.count;
  h->parent = clt_alloc(count, sizeof *h->parent);
  h->orders = clt_alloc(count, sizeof *h->orders);
  h->level = clt_alloc(count + 2, sizeof *h->level);
  h->leaf = clt_alloc(count, sizeof *h->leaf);
  if (!h->parent || !h->orders || !h->level || !h->leaf) {
    return out_of_memory(h, error);
  }
  for (int k = 0; k < h->clusters.count; k++) {
    h->parent[k] = -1;
  }
  for (int k = 0; k < h->clusters.count; k++) {
    int child = h->clusters.cluster[k].child;
    if (child >= 0) {
      h->parent[child] = h->parent[child + 1] = k;
    } else {
      h->leaf[h->leaves++] = k;
    }
  }
  for (int k = 0; k < h->clusters.count; k++) { /* a level begins with the first child of the level before */
    if (k == 0 || h->parent[k] >= h->level[h->levels - 1]) {
      h->level[h->levels++] = k;
    }
  }
  h->level[h->levels] = h->clusters.count;
  return CLT_OK;
}

/* A place of the surface in units of the cluster's box, -1..1 across it. */
static void place_in(const clt_cluster *cluster, const clt_plane *plane, clt_vector point, double at[2]) {
  clt_vector from = vec_sub(point, plane->origin);
  for (int axis = 0; axis < 2; axis++) {
    double size = cluster->high[axis] - cluster->low[axis];
    at[axis] = (2.0 * vec_dot(from, plane->along[axis]) - cluster->low[axis] - cluster->high[axis]) / size;
  }
}

/* Integrals of the nodes' polynomials over an element, by a rule that is exact for them: 2 x 2 points for those of
 * degree 3 in either direction, 4 x 4 drawn together (Duffy 1982) for a triangle, where they are of degree 6. */
static void integrate_basis(const clt_cluster *cluster, const clt_plane *plane, const clt_rectangle *element,
                            float *basis) {
  static const struct {
    int order;
    double at[4], weight[4];
  } rules[2] = {
      {3, {0.1127016653792583, 0.5, 0.8872983346207417}, {0.2777777777777778, 0.4444444444444444, 0.2777777777777778}},
      {4,
       {0.0694318442029737, 0.3300094782075719, 0.6699905217924281, 0.9305681557970263},
       {0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269}}};
  const int which = element->triangle, order = rules[which].order;
  double sum[CLT_NODES] = {0.0}, area = clt_rectangle_area(element);
  for (int p = 0; p < order; p++) {
    for (int q = 0; q < order; q++) {
      double t = rules[which].at[q], across = element->triangle ? 1.0 - t : 1.0, at[2], weights[CLT_NODES];
      double share = rules[which].weight[p] * rules[which].weight[q] * (element->triangle ? 2.0 * across : 1.0);
      clt_vector point = vec_along(element->corner, rules[which].at[p] * across, element->u, t, element->v);
      place_in(cluster, plane, point, at);
      clt_interpolation_plane(CLT_ORDER_MAX, at, weights);
      for (int a = 0; a < CLT_NODES; a++) {
        sum[a] += area * share * weights[a];
      }
    }
  }
  for (int a = 0; a < CLT_NODES; a++) {
    basis[a] = (float)sum[a];
  }
}

static void fill_transfer(clt_hierarchy *h, int number) {
  const clt_cluster *cluster = &h->clusters.cluster[number], *parent = &h->clusters.cluster[h->parent[number]];
  for (int axis = 0; axis < 2; axis++) {
    double middle = 0.5 * (cluster->low[axis] + cluster->high[axis]), half = cluster->high[axis] - middle;
    double size = parent->high[axis] - parent->low[axis];
    for (int a = 0; a < CLT_ORDER_MAX; a++) {
      double at = middle + half * clt_interpolation_node(CLT_ORDER_MAX, a), weights[CLT_ORDER_MAX];
      clt_interpolation_weights(CLT_ORDER_MAX, (2.0 * at - parent->low[axis] - parent->high[axis]) / size, weights);
      for (int b = 0; b < CLT_ORDER_MAX; b++) {
        h->transfer[number][axis][a][b] = (float)weights[b];
      }
    }
  }
}

static clt_status fill_bases(clt_hierarchy *h, const clt_parts *parts, clt_error *error) {
  const clt_clusters *clusters = &h->clusters;
  h->basis = clt_alloc((size_t)clusters->elements * CLT_NODES, sizeof *h->basis);
  h->transfer = clt_alloc((size_t)clusters->count, sizeof *h->transfer);
  if (h->basis == NULL || h->transfer == NULL) {
    return out_of_memory(h, error);
  }
#pragma omp parallel for schedule(dynamic, 8)
  for (int k = 0; k < clusters->count; k++) {
    const clt_cluster *cluster = &clusters->cluster[k];
    for (int e = cluster->begin; e < cluster->end && cluster->child < 0; e++) {
      integrate_basis(cluster, &clusters->plane[cluster->surface], &parts->elements[clusters->order[e]],
                      &h->basis[(size_t)e * CLT_NODES]);
    }
    if (h->parent[k] >= 0) {
      fill_transfer(h, k);
    }
  }
  for (int order = 1; order < CLT_ORDER_MAX; order++) {
    for (int a = 0; a < CLT_ORDER_MAX; a++) {
      double weights[CLT_ORDER_MAX] = {0.0};
      clt_interpolation_weights(order, clt_interpolation_node(CLT_ORDER_MAX, a), weights);
      for (int b = 0; b < CLT_ORDER_MAX; b++) {
        h->reduction[order][a][b] = (float)weights[b];
      }
    }
  }
  return CLT_OK;
}

static size_t values_of(const clt_hierarchy *h, const clt_block *block) {
  const clt_cluster *a = &h->clusters.cluster[block->a], *b = &h->clusters.cluster[block->b];
  size_t nodes = (size_t)(block->order * block->order);
  return block->order == CLT_BLOCK_NEAR ? (size_t)(a->end - a->begin) * (size_t)(b->end - b->begin) : nodes * nodes;
}

/* Each block links its clusters both ways. at: where each block's values begin. */
static clt_status link_clusters(clt_hierarchy *h, const clt_blocks *blocks, bool near, const size_t *at,
                                clt_links *links, clt_error *error) {
  size_t count = (size_t)h->clusters.count, total = 0;
  links->start = clt_alloc(count + 2, sizeof *links->start);
  size_t *next = links->start; /* counted two places on, so that filling moves each start to where it belongs */
  for (size_t k = 0; k < blocks->count && next != NULL; k++) {
    const clt_block *block = &blocks->block[k];
    if ((block->order == CLT_BLOCK_NEAR) == near) {
      next[block->a + 2]++;
      next[block->b + 2]++;
      total += 2;
    }
  }
  links->link = clt_alloc(total + 1, sizeof *links->link);
  if (next == NULL || links->link == NULL) {
    return out_of_memory(h, error);
  }
  for (size_t k = 2; k < count + 2; k++) {
    next[k] += next[k - 1];
  }
  for (size_t k = 0; k < blocks->count; k++) {
    const clt_block *block = &blocks->block[k];
    if ((block->order == CLT_BLOCK_NEAR) == near) {
      clt_link link = {.from = (uint32_t)block->b, .values = (uint32_t)at[k], .order = (uint8_t)block->order};
      links->link[next[block->a + 1]++] = link;
      link.from = (uint32_t)block->a;
      link.turned = true;
      links->link[next[block->b + 1]++] = link;
    }
  }
  return CLT_OK;
}

static void fill_far(const clt_hierarchy *h, const clt_block *block, float *values) {
  int order = block->order, nodes = order * order;
  if (order == 1) {
    values[0] = block->value;
    return;
  }
  const clt_clusters *clusters = &h->clusters;
  clt_vector at[2][CLT_NODES], normal[2];
  const int cluster[2] = {block->a, block->b};
  for (int side = 0; side < 2; side++) {
    normal[side] = clusters->plane[clusters->cluster[cluster[side]].surface].normal;
    for (int k = 0; k < nodes; k++) {
      const double place[2] = {clt_interpolation_node(order, k / order), clt_interpolation_node(order, k % order)};
      at[side][k] = clt_cluster_point(clusters, cluster[side], place);
    }
  }
  for (int i = 0; i < nodes; i++) {
    for (int j = 0; j < nodes; j++) {
      values[i * nodes + j] = (float)clt_blocks_kernel(at[0][i], normal[0], at[1][j], normal[1]);
    }
  }
}

/* True where one of the surfaces may stand between two elements. */
static bool may_be_parted(const clt_parts *parts, const clt_block *block, const int *blockers, int i, int j) {
  if (block->blockers <= 0) {
    return block->blockers < 0;
  }
  const clt_rectangle *a = &parts->elements[i], *b = &parts->elements[j];
  clt_vector corners_a[4], corners_b[4];
  clt_shaft shaft;
  for (int k = 0; k < 4; k++) {
    corners_a[k] = clt_rectangle_vertex(a, k);
    corners_b[k] = clt_rectangle_vertex(b, k);
  }
  clt_shaft_init(&shaft, corners_a, a->normal, corners_b, b->normal);
  for (int k = 0; k < block->blockers; k++) {
    if (clt_shaft_may_hold(&shaft, &parts->surfaces[blockers[k]])) {
      return true;
    }
  }
  return false;
}

static void fill_near(const clt_hierarchy *h, const clt_parts *parts, const clt_block *block, const int *blockers,
                      float *values) {
  const clt_cluster *of_a = &h->clusters.cluster[block->a], *of_b = &h->clusters.cluster[block->b];
  for (int k = of_a->begin; k < of_a->end; k++) {
    for (int l = of_b->begin; l < of_b->end; l++) {
      int i = h->clusters.order[k], j = h->clusters.order[l], low = i < j ? i : j, high = i < j ? j : i;
      bool parted = may_be_parted(parts, block, blockers, i, j);
      double visible = parted ? clt_exchange_visible(parts, low, high) : 1.0;
      *values++ = visible > 0.0
                      ? (float)(visible * clt_formfactor_exchange(&parts->elements[low], &parts->elements[high]))
                      : 0.0f;
    }
  }
}

static clt_status fill_blocks(clt_hierarchy *h, const clt_parts *parts, const clt_blocks *blocks, const size_t *at,
                              clt_error *error) {
  h->values = clt_alloc(h->value_count + 1, sizeof *h->values);
  if (h->values == NULL || h->value_count > UINT32_MAX) {
    return out_of_memory(h, error);
  }
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t k = 0; k < blocks->count; k++) {
    const clt_block *block = &blocks->block[k];
    if (block->order == CLT_BLOCK_NEAR) {
      fill_near(h, parts, block, &blocks->blocker[block->first_blocker], &h->values[at[k]]);
    } else {
      fill_far(h, block, &h->values[at[k]]);
    }
  }
  return CLT_OK;
}

static clt_status take_blocks(clt_hierarchy *h, const clt_parts *parts, const clt_blocks *blocks, clt_error *error) {
  size_t *at = clt_alloc(blocks->count + 1, sizeof *at);
  if (at == NULL) {
    return out_of_memory(h, error);
  }
  for (size_t k = 0; k < blocks->count; k++) {
    const clt_block *block = &blocks->block[k];
    at[k] = h->value_count;
    h->value_count += values_of(h, block);
    h->orders[block->a] |= (uint8_t)(1 << block->order);
    h->orders[block->b] |= (uint8_t)(1 << block->order);
    h->block_count[block->order == CLT_BLOCK_NEAR]++;
  }
  clt_status status = fill_blocks(h, parts, blocks, at, error);
  if (status == CLT_OK) {
    status = link_clusters(h, blocks, false, at, &h->far, error);
  }
  if (status == CLT_OK) {
    status = link_clusters(h, blocks, true, at, &h->near, error);
  }
  free(at);
  return status;
}

/* What the energy of H is brought in order with. */
typedef struct balance {
  clt_lanes *x, *y, *work;
  double *scale, *area, *sums;
} balance;

/* sums = scale H scale */
static void scaled_sums(const clt_hierarchy *h, balance *b) {
  for (int e = 0; e < h->clusters.elements; e++) {
    b->x[e] = (clt_lanes){(float)b->scale[e]};
  }
  clt_hierarchy_product(h, b->x, b->y, b->work);
  for (int e = 0; e < h->clusters.elements; e++) {
    b->sums[e] = b->scale[e] * (double)b->y[e][0];
  }
}

/* As in exchange.c, to the precision of float. */
static void conserve(const clt_hierarchy *h, balance *b) {
  enum { SWEEPS_MAX = 100 };
  double off = 1.0;
  for (int sweep = 0; sweep < SWEEPS_MAX && off > 1e-6; sweep++) {
    off = 0.0;
    for (int e = 0; e < h->clusters.elements; e++) {
      if (b->sums[e] > 0.0) {
        b->scale[e] *= sqrt(b->area[e] / b->sums[e]);
        off = fmax(off, fabs(b->sums[e] / b->area[e] - 1.0));
      }
    }
    scaled_sums(h, b);
  }
}

static void limit(const clt_hierarchy *h, balance *b) {
  for (int e = 0; e < h->clusters.elements; e++) {
    b->scale[e] = b->sums[e] > b->area[e] ? b->area[e] / b->sums[e] : 1.0;
  }
}

/* X H X: the bases and the elements of near blocks take X. */
static void apply_scale(clt_hierarchy *h, const double *scale) {
#pragma omp parallel for schedule(static)
  for (int e = 0; e < h->clusters.elements; e++) {
    for (int a = 0; a < CLT_NODES; a++) {
      h->basis[(size_t)e * CLT_NODES + (size_t)a] *= (float)scale[e];
    }
  }
#pragma omp parallel for schedule(dynamic, 8)
  for (int c = 0; c < h->clusters.count; c++) {
    const clt_cluster *a = &h->clusters.cluster[c];
    for (size_t k = h->near.start[c]; k < h->near.start[c + 1]; k++) {
      const clt_link *link = &h->near.link[k];
      const clt_cluster *b = &h->clusters.cluster[link->from];
      float *value = &h->values[link->values];
      for (int i = a->begin; i < a->end && !link->turned; i++) {
        for (int j = b->begin; j < b->end; j++) {
          *value++ *= (float)(scale[i] * scale[j]);
        }
      }
    }
  }
}

static clt_status balance_energy(clt_hierarchy *h, const clt_parts *parts, clt_error *error) {
  size_t count = (size_t)h->clusters.elements;
  clt_lanes *lanes = clt_alloc(2 * count + clt_hierarchy_work(h), sizeof *lanes);
  double *values = clt_alloc(3 * count, sizeof *values);
  if (lanes == NULL || values == NULL) {
    free(lanes);
    free(values);
    return out_of_memory(h, error);
  }
  balance b = {lanes, lanes + count, lanes + 2 * count, values, values + count, values + 2 * count};
  for (size_t e = 0; e < count; e++) {
    b.scale[e] = 1.0;
    b.area[e] = clt_rectangle_area(&parts->elements[h->clusters.order[e]]);
  }
  scaled_sums(h, &b);
  if (clt_exchange_closed(parts)) {
    conserve(h, &b);
  } else {
    limit(h, &b);
  }
  apply_scale(h, b.scale);
  free(lanes);
  free(values);
  return CLT_OK;
}

static clt_status build(clt_hierarchy *h, const clt_parts *parts, double tolerance, clt_error *error) {
  clt_blocks blocks = {.count = 0};
  /* probes stand where interpolation errs most, some hundred times as much as on average over a smooth vector */
  const clt_accuracy accuracy = {.kernel = 100.0 * tolerance, .rest = 10.0 * tolerance};
  clt_status status = clt_clusters_init(&h->clusters, parts, error);
  if (status == CLT_OK) {
    status = clt_blocks_init(&blocks, parts, &h->clusters, &accuracy, error);
  }
  if (status == CLT_OK) {
    status = drop_unneeded(h, &blocks, error);
  }
  if (status == CLT_OK) {
    status = clt_blocks_part_near(&blocks, &h->clusters, error);
  }
  if (status == CLT_OK) {
    status = lay_out(h, error);
  }
  if (status == CLT_OK) {
    status = fill_bases(h, parts, error);
  }
  if (status == CLT_OK) {
    status = take_blocks(h, parts, &blocks, error);
  }
  clt_blocks_finish(&blocks);
  return status == CLT_OK ? balance_energy(h, parts, error) : status;
}

clt_status clt_hierarchy_create(const clt_parts *parts, double tolerance, clt_hierarchy **out, clt_error *error) {
  clt_hierarchy *h = clt_alloc(1, sizeof *h);
  if (h == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the exchange of light");
  }
  clt_status status = build(h, parts, tolerance, error);
  if (status != CLT_OK) {
    clt_hierarchy_destroy(h);
    return status;
  }
  *out = h;
  return CLT_OK;
}

void clt_hierarchy_destroy(clt_hierarchy *h) {
  if (h != NULL) {
    clt_clusters_finish(&h->clusters);
    free(h->parent);
    free(h->orders);
    free(h->level);
    free(h->leaf);
    free(h->basis);
    free(h->transfer);
    free(h->far.start);
    free(h->far.link);
    free(h->near.start);
    free(h->near.link);
    free(h->values);
    free(h);
  }
}

clt_hierarchy_size clt_hierarchy_measure(const clt_hierarchy *h) {
  size_t elements = (size_t)h->clusters.elements, clusters = (size_t)h->clusters.count;
  size_t blocks = h->block_count[0] + h->block_count[1];
  return (clt_hierarchy_size){.elements = elements,
                              .clusters = clusters,
                              .far_blocks = h->block_count[0],
                              .near_blocks = h->block_count[1],
                              .bytes = elements * (CLT_NODES * sizeof *h->basis + sizeof *h->clusters.order) +
                                       clusters * (sizeof *h->clusters.cluster + sizeof *h->transfer) +
                                       2 * blocks * sizeof(clt_link) + h->value_count * sizeof *h->values};
}

bool clt_hierarchy_is_empty(const clt_hierarchy *h) {
  return h->block_count[0] + h->block_count[1] == 0;
}

const int *clt_hierarchy_order(const clt_hierarchy *h) {
  return h->clusters.order;
}

size_t clt_hierarchy_work(const clt_hierarchy *h) {
  return (size_t)h->clusters.count * 2 * CLT_MOMENTS;
}
