/* Products with hierarchy storage. */
#include "transport/hierarchy.h"

#include <string.h>

#include "transport/kernels.h"

enum { WORTH_SHARING = 16384 }; /* cells from which threads pay */

/* One side of the far light: what cells are multiplied by, and the factor between leaves and ranks. */
typedef struct side {
  const float *cells, *factor;
} side;

const clt_hierarchy_storage *clt_hierarchic_of(const clt_transport *transport) {
  return transport->kind == &clt_kind_hierarchy ? transport->storage : NULL;
}

double clt_transport_simplified(const clt_transport *transport) {
  const clt_hierarchy_storage *own = clt_hierarchic_of(transport);
  return own != NULL ? own->error : 0;
}

static side side_of(const clt_transport *transport, int channel, const float *cells, const float *factor) {
  const clt_hierarchy_storage *own = transport->storage;
  return (side){cells + (size_t)channel * transport->cols,
                factor + (size_t)channel * CLT_LEAF_TERMS * own->leaves * own->rank};
}

static void fill_places(int32_t count, double *u) {
  for (int32_t k = 0; k < count; k++) {
    u[k] = clt_leaf_place(k, count);
  }
}

/* m = P' diag(cells) x over one leaf; x = NULL stands for 1 everywhere. Sums are kept by columns, so that the loop over
 * a row is a map. */
static void sum_leaf(const clt_leaf *leaf, int width, const float *cells, const double *x, double m[CLT_LEAF_TERMS]) {
  double even[CLT_LEAF_SIDE_MAX] = {0}, tilted[CLT_LEAF_SIDE_MAX] = {0}, u[CLT_LEAF_SIDE_MAX];
  for (int32_t row = 0; row < leaf->height; row++) {
    const size_t first = (size_t)(leaf->y + row) * (size_t)width + (size_t)leaf->x;
    const double v = clt_leaf_place(row, leaf->height);
    for (int32_t k = 0; k < leaf->width; k++) {
      const double value = (double)cells[first + (size_t)k] * (x != NULL ? x[first + (size_t)k] : 1);
      even[k] += value;
      tilted[k] += v * value;
    }
  }
  fill_places(leaf->width, u);
  memset(m, 0, CLT_LEAF_TERMS * sizeof *m);
  for (int32_t k = 0; k < leaf->width; k++) {
    m[0] += even[k];
    m[1] += even[k] * u[k];
    m[2] += tilted[k];
    m[3] += tilted[k] * u[k];
  }
}

/* y += diag(cells) P f over one leaf. */
static void spread_leaf(const clt_leaf *leaf, int width, const float *cells, const double f[CLT_LEAF_TERMS],
                        double *y) {
  double u[CLT_LEAF_SIDE_MAX];
  fill_places(leaf->width, u);
  for (int32_t row = 0; row < leaf->height; row++) {
    const size_t first = (size_t)(leaf->y + row) * (size_t)width + (size_t)leaf->x;
    const double v = clt_leaf_place(row, leaf->height), even = f[0] + v * f[2], tilted = f[1] + v * f[3];
    for (int32_t k = 0; k < leaf->width; k++) {
      y[first + (size_t)k] += (double)cells[first + (size_t)k] * (even + tilted * u[k]);
    }
  }
}

static void rows_of(const float *factor, size_t leaf, size_t rank, const float *row[CLT_PLAIN_ROWS]) {
  for (size_t term = 0; term < CLT_LEAF_TERMS; term++) {
    row[term] = factor + (CLT_LEAF_TERMS * leaf + term) * rank;
  }
}

/* y += diag(to) P to.factor from.factor' P' diag(from) x */
static void far_product(const clt_transport *transport, int channel, side from, side to, const double *x, double *y) {
  const clt_hierarchy_storage *own = transport->storage;
  const clt_plain_kernels *kernels = clt_plain_choose();
  const size_t leaves = own->leaves, rank = own->rank;
  double *z = own->scratch + (size_t)channel * (CLT_HIERARCHY_CHUNKS + 1) * rank, *part = z + rank;
  memset(z, 0, (CLT_HIERARCHY_CHUNKS + 1) * rank * sizeof *z);
#pragma omp parallel for schedule(dynamic, 1) if (transport->cols >= WORTH_SHARING)
  for (size_t chunk = 0; chunk < CLT_HIERARCHY_CHUNKS; chunk++) {
    for (size_t leaf = leaves * chunk / CLT_HIERARCHY_CHUNKS; leaf < leaves * (chunk + 1) / CLT_HIERARCHY_CHUNKS;
         leaf++) {
      const float *row[CLT_PLAIN_ROWS];
      double m[CLT_LEAF_TERMS];
      sum_leaf(&own->leaf[leaf], transport->width, from.cells, x, m);
      rows_of(from.factor, leaf, rank, row);
      kernels->add_float(row, m, rank, part + chunk * rank);
    }
  }
  for (size_t k = 0; k < CLT_HIERARCHY_CHUNKS * rank; k++) {
    z[k % rank] += part[k];
  }
#pragma omp parallel for schedule(dynamic, 8) if (transport->cols >= WORTH_SHARING)
  for (size_t leaf = 0; leaf < leaves; leaf++) {
    const float *row[CLT_PLAIN_ROWS];
    double f[CLT_LEAF_TERMS];
    rows_of(to.factor, leaf, rank, row);
    kernels->dot_float(row, z, rank, f);
    spread_leaf(&own->leaf[leaf], transport->width, to.cells, f, y);
  }
}

static double mean_of(const double *values, size_t count) {
  double sum = 0;
  for (size_t j = 0; j < count; j++) {
    sum += values[j];
  }
  return sum / (double)count;
}

static void hierarchy_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t cells = transport->cols, at = (size_t)channel * cells;
  const float *value = own->value + (size_t)channel * (size_t)own->start[cells];
  const double mean = mean_of(x, cells);
#pragma omp parallel for schedule(static) if (cells >= WORTH_SHARING)
  for (size_t i = 0; i < cells; i++) {
    double sum = (double)own->own[at + i] * x[i] + (double)own->flood[at + i] * mean;
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      sum += (double)value[e] * x[own->cell[e]];
    }
    y[i] = sum;
  }
  pthread_mutex_lock(&own->turn[channel]);
  far_product(transport, channel, side_of(transport, channel, own->gather, own->right),
              side_of(transport, channel, own->scale, own->left), x, y);
  pthread_mutex_unlock(&own->turn[channel]);
}

static void hierarchy_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t cells = transport->cols, at = (size_t)channel * cells;
  const float *value = own->value + (size_t)channel * (size_t)own->start[cells];
  double flood = 0;
  for (size_t i = 0; i < cells; i++) {
    flood += (double)own->flood[at + i] * y[i];
  }
  for (size_t j = 0; j < cells; j++) {
    x[j] = (double)own->own[at + j] * y[j] + flood / (double)cells;
  }
  for (size_t i = 0; i < cells; i++) {
    for (int64_t e = own->start[i]; y[i] != 0 && e < own->start[i + 1]; e++) {
      x[own->cell[e]] += (double)value[e] * y[i];
    }
  }
  pthread_mutex_lock(&own->turn[channel]);
  far_product(transport, channel, side_of(transport, channel, own->scale, own->left),
              side_of(transport, channel, own->gather, own->right), y, x);
  pthread_mutex_unlock(&own->turn[channel]);
}

/* core = left right' of one leaf with itself. */
static void leaf_core(const clt_hierarchy_storage *own, side to, side from, size_t leaf,
                      double core[CLT_LEAF_TERMS][CLT_LEAF_TERMS]) {
  for (size_t s = 0; s < CLT_LEAF_TERMS; s++) {
    for (size_t t = 0; t < CLT_LEAF_TERMS; t++) {
      core[s][t] = 0;
      for (size_t r = 0; r < own->rank; r++) {
        core[s][t] += (double)to.factor[(CLT_LEAF_TERMS * leaf + s) * own->rank + r] *
                      (double)from.factor[(CLT_LEAF_TERMS * leaf + t) * own->rank + r];
      }
    }
  }
}

static void hierarchy_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  const clt_hierarchy_storage *own = transport->storage;
  const side to = side_of(transport, channel, own->scale, own->left);
  const side from = side_of(transport, channel, own->gather, own->right);
  const size_t at = (size_t)channel * transport->cols;
  for (size_t leaf = 0; leaf < own->leaves; leaf++) {
    const clt_leaf box = own->leaf[leaf];
    double core[CLT_LEAF_TERMS][CLT_LEAF_TERMS];
    leaf_core(own, to, from, leaf, core);
    for (int32_t k = 0; k < box.width * box.height; k++) {
      const double u = clt_leaf_place(k % box.width, box.width), v = clt_leaf_place(k / box.width, box.height);
      const double term[CLT_LEAF_TERMS] = {1, u, v, u * v};
      const size_t i = (size_t)(box.y + k / box.width) * (size_t)transport->width + (size_t)(box.x + k % box.width);
      double sum = 0;
      for (int t = 0; t < CLT_LEAF_TERMS * CLT_LEAF_TERMS; t++) {
        sum += term[t / CLT_LEAF_TERMS] * core[t / CLT_LEAF_TERMS][t % CLT_LEAF_TERMS] * term[t % CLT_LEAF_TERMS];
      }
      diagonal[i] = (double)own->own[at + i] + (double)own->flood[at + i] / (double)transport->cols +
                    (double)to.cells[i] * sum * (double)from.cells[i];
    }
  }
}

static void hierarchy_row_sums(const clt_transport *transport, int channel, double *sums) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t cells = transport->cols, at = (size_t)channel * cells;
  const float *value = own->value + (size_t)channel * (size_t)own->start[cells];
  for (size_t i = 0; i < cells; i++) {
    sums[i] = (double)own->own[at + i] + (double)own->flood[at + i];
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      sums[i] += (double)value[e];
    }
  }
  pthread_mutex_lock(&own->turn[channel]);
  far_product(transport, channel, side_of(transport, channel, own->gather, own->right),
              side_of(transport, channel, own->scale, own->left), NULL, sums);
  pthread_mutex_unlock(&own->turn[channel]);
}

static size_t hierarchy_bytes(const clt_transport *transport) {
  const clt_hierarchy_storage *own = transport->storage;
  const size_t entries = (size_t)own->start[transport->cols], cells = transport->cols;
  const size_t pattern = entries * sizeof *own->cell + (cells + 1) * sizeof *own->start;
  const size_t factors = 2 * CLT_LEAF_TERMS * own->leaves * own->rank;
  return (size_t)transport->channels * (pattern + (entries + factors + 4 * cells) * sizeof(float));
}

static float *hierarchy_entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL;
}

const clt_kind clt_kind_hierarchy = {.name = "hierarchy",
                                     .apply = hierarchy_apply,
                                     .apply_transposed = hierarchy_apply_transposed,
                                     .diagonal = hierarchy_diagonal,
                                     .row_sums = hierarchy_row_sums,
                                     .bytes = hierarchy_bytes,
                                     .entries = hierarchy_entries,
                                     .check = clt_hierarchic_check,
                                     .load = clt_hierarchic_load,
                                     .save = clt_hierarchic_save,
                                     .destroy = clt_hierarchic_destroy};
