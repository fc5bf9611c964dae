#include <string.h>

#include "sim/hierarchy_parts.h"

/* Levels of fewer clusters are left to one thread. */
enum { FEW_CLUSTERS = 64 };
/* Elements whose sum is formed before it joins the others, so that rounding does not add up. */
enum { RUN = 64 };

/* A cluster's moments: what it sends, and what it receives. */
static clt_lanes *sent(clt_lanes *work, int cluster) {
  return &work[(size_t)cluster * 2 * CLT_MOMENTS];
}

static clt_lanes *received(clt_lanes *work, int cluster) {
  return &work[(size_t)cluster * 2 * CLT_MOMENTS + CLT_MOMENTS];
}

static clt_lanes *highest(clt_lanes *moments) {
  return &moments[clt_moments_of(CLT_ORDER_MAX)];
}

/* out_kl += sum over ij of left_ik right_jl in_ij, or with both transposed: a matrix for each axis of the plane. */
static inline void change_nodes(const float *left, const float *right, int from, int to, bool transposed,
                                const clt_lanes *in, clt_lanes *out) {
  clt_lanes half[CLT_NODES] = {{0}};
  for (int i = 0; i < from; i++) {
    for (int j = 0; j < from; j++) {
      for (int l = 0; l < to; l++) {
        half[i * to + l] += right[transposed ? l * CLT_ORDER_MAX + j : j * CLT_ORDER_MAX + l] * in[i * from + j];
      }
    }
  }
  for (int i = 0; i < from; i++) {
    for (int k = 0; k < to; k++) {
      float weight = left[transposed ? k * CLT_ORDER_MAX + i : i * CLT_ORDER_MAX + k];
      for (int l = 0; l < to; l++) {
        out[k * to + l] += weight * half[i * to + l];
      }
    }
  }
}

/* The moments of the lower orders that the cluster's blocks ask for. */
static void reduce(const clt_hierarchy *h, int cluster, clt_lanes *work) {
  clt_lanes *moments = sent(work, cluster);
  for (int order = 1; order < CLT_ORDER_MAX; order++) {
    if (h->orders[cluster] & 1 << order) {
      memset(&moments[clt_moments_of(order)], 0, (size_t)(order * order) * sizeof *moments);
      change_nodes(h->reduction[order][0], h->reduction[order][0], CLT_ORDER_MAX, order, false, highest(moments),
                   &moments[clt_moments_of(order)]);
    }
  }
}

/* moments = V' x of a leaf */
static void gather(const clt_hierarchy *h, int cluster, const clt_lanes *x, clt_lanes *work) {
  clt_lanes *moments = highest(sent(work, cluster));
  const clt_cluster *leaf = &h->clusters.cluster[cluster];
  memset(moments, 0, CLT_NODES * sizeof *moments);
  for (int begin = leaf->begin; begin < leaf->end; begin += RUN) {
    int end = begin + RUN < leaf->end ? begin + RUN : leaf->end;
    clt_lanes sum[CLT_NODES] = {{0}};
    for (int e = begin; e < end; e++) {
      const float *weights = &h->basis[(size_t)e * CLT_NODES];
      for (int a = 0; a < CLT_NODES; a++) {
        sum[a] += weights[a] * x[e];
      }
    }
    for (int a = 0; a < CLT_NODES; a++) {
      moments[a] += sum[a];
    }
  }
  reduce(h, cluster, work);
}

static void gather_children(const clt_hierarchy *h, int cluster, clt_lanes *work) {
  int child = h->clusters.cluster[cluster].child;
  clt_lanes *moments = highest(sent(work, cluster));
  if (child < 0) {
    return;
  }
  memset(moments, 0, CLT_NODES * sizeof *moments);
  for (int k = child; k < child + 2; k++) {
    change_nodes(h->transfer[k][0][0], h->transfer[k][1][0], CLT_ORDER_MAX, CLT_ORDER_MAX, false,
                 highest(sent(work, k)), moments);
  }
  reduce(h, cluster, work);
}

/* out += block in, for a block of rows x columns values, or its transpose. */
static inline void add_product(const float *block, int rows, int columns, bool turned, const clt_lanes *in,
                               clt_lanes *out) {
  for (int i = 0; i < rows; i++, block += columns) {
    if (turned) {
      for (int j = 0; j < columns; j++) {
        out[j] += block[j] * in[i];
      }
    } else {
      clt_lanes sum[2] = {{0}, {0}};
      int j = 0;
      for (; j + 2 <= columns; j += 2) {
        sum[0] += block[j] * in[j];
        sum[1] += block[j + 1] * in[j + 1];
      }
      for (; j < columns; j++) {
        sum[0] += block[j] * in[j];
      }
      out[i] += sum[0] + sum[1];
    }
  }
}

/* What a cluster receives through its own far blocks, in moments of the highest order. */
static void exchange(const clt_hierarchy *h, int cluster, clt_lanes *work) {
  clt_lanes *moments = received(work, cluster);
  memset(moments, 0, CLT_MOMENTS * sizeof *moments);
  for (size_t k = h->far.start[cluster]; k < h->far.start[cluster + 1]; k++) {
    const clt_link *link = &h->far.link[k];
    int first = clt_moments_of(link->order), nodes = link->order * link->order;
    const clt_lanes *in = &sent(work, (int)link->from)[first];
    const float *values = &h->values[link->values];
    if (nodes == 1) {
      moments[0] += values[0] * in[0];
    } else if (nodes == CLT_NODES) {
      add_product(values, CLT_NODES, CLT_NODES, link->turned, in, &moments[first]);
    } else {
      add_product(values, nodes, nodes, link->turned, in, &moments[first]);
    }
  }
  for (int order = 1; order < CLT_ORDER_MAX; order++) {
    if (h->orders[cluster] & 1 << order) {
      change_nodes(h->reduction[order][0], h->reduction[order][0], order, CLT_ORDER_MAX, true,
                   &moments[clt_moments_of(order)], highest(moments));
    }
  }
}

static void receive_from_parent(const clt_hierarchy *h, int cluster, clt_lanes *work) {
  int parent = h->parent[cluster];
  if (parent >= 0) {
    change_nodes(h->transfer[cluster][0][0], h->transfer[cluster][1][0], CLT_ORDER_MAX, CLT_ORDER_MAX, true,
                 highest(received(work, parent)), highest(received(work, cluster)));
  }
}

/* y = V moments of a leaf */
static void spread(const clt_hierarchy *h, int cluster, clt_lanes *y, clt_lanes *work) {
  const clt_lanes *moments = highest(received(work, cluster));
  const clt_cluster *leaf = &h->clusters.cluster[cluster];
  for (int e = leaf->begin; e < leaf->end; e++) {
    const float *weights = &h->basis[(size_t)e * CLT_NODES];
    clt_lanes sum[4] = {{0}, {0}, {0}, {0}};
    for (int a = 0; a < CLT_NODES; a++) {
      sum[a % 4] += weights[a] * moments[a];
    }
    y[e] = (sum[0] + sum[1]) + (sum[2] + sum[3]);
  }
}

static void add_near(const clt_hierarchy *h, int cluster, const clt_lanes *x, clt_lanes *y) {
  const clt_cluster *leaf = &h->clusters.cluster[cluster];
  int held = leaf->end - leaf->begin;
  for (size_t k = h->near.start[cluster]; k < h->near.start[cluster + 1]; k++) {
    const clt_link *link = &h->near.link[k];
    const clt_cluster *from = &h->clusters.cluster[link->from];
    int others = from->end - from->begin;
    add_product(&h->values[link->values], link->turned ? others : held, link->turned ? held : others, link->turned,
                &x[from->begin], &y[leaf->begin]);
  }
}

/* The first level from which on there are many clusters. */
static int first_wide_level(const clt_hierarchy *h) {
  int level = 0;
  while (level < h->levels && h->level[level + 1] - h->level[level] < FEW_CLUSTERS) {
    level++;
  }
  return level;
}

static void gather_up(const clt_hierarchy *h, int wide, clt_lanes *work) {
  for (int level = h->levels - 1; level >= wide; level--) {
#pragma omp for schedule(static)
    for (int k = h->level[level]; k < h->level[level + 1]; k++) {
      gather_children(h, k, work);
    }
  }
#pragma omp single
  for (int k = h->level[wide] - 1; k >= 0; k--) {
    gather_children(h, k, work);
  }
}

static void receive_down(const clt_hierarchy *h, int wide, clt_lanes *work) {
#pragma omp single
  for (int k = 0; k < h->level[wide]; k++) {
    receive_from_parent(h, k, work);
  }
  for (int level = wide; level < h->levels; level++) {
#pragma omp for schedule(static)
    for (int k = h->level[level]; k < h->level[level + 1]; k++) {
      receive_from_parent(h, k, work);
    }
  }
}

void clt_hierarchy_product(const clt_hierarchy *h, const clt_lanes *x, clt_lanes *y, clt_lanes *work) {
  int wide = first_wide_level(h);
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 8)
    for (int k = 0; k < h->leaves; k++) {
      gather(h, h->leaf[k], x, work);
    }
    gather_up(h, wide, work);
#pragma omp for schedule(dynamic, 8)
    for (int k = 0; k < h->clusters.count; k++) {
      exchange(h, k, work);
    }
    receive_down(h, wide, work);
#pragma omp for schedule(dynamic, 8)
    for (int k = 0; k < h->leaves; k++) {
      spread(h, h->leaf[k], y, work);
      add_near(h, h->leaf[k], x, y);
    }
  }
}
