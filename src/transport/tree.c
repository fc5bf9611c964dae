/* Tree storage: compressed sparse rows over the nodes of the grid's pyramid; every channel has the same pattern. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/check.h"
#include "transport/kind.h"
#include "transport/pyramid.h"

/* A transposed product scatters into this many partial results, one for each slice of rows, and adds them in order: the
 * number is fixed so that the result does not depend on the number of threads. */
enum { SLICES = 4 };

enum { WORTH_SHARING = 16384 }; /* entries from which threads pay */

typedef struct tree {
  clt_pyramid pyramid;
  size_t nodes;
  int64_t *start; /* rows + 1 */
  int32_t *node;  /* entries */
  float *value;   /* channels x entries */
  size_t slice[SLICES + 1];
  /* SLICES x nodes for each channel. A product cannot report that memory is short, so it has its room beforehand;
   * products of one channel take turns, those of different channels run side by side. */
  double *scratch;
  pthread_mutex_t turn[CLT_CHANNELS_MAX];
} tree;

static const float *values_of(const clt_transport *transport, int channel) {
  const tree *own = transport->storage;
  return own->value + (size_t)channel * (size_t)own->start[transport->rows];
}

static double *begin_turn(const clt_transport *transport, int channel) {
  tree *own = transport->storage;
  pthread_mutex_lock(&own->turn[channel]);
  return own->scratch + (size_t)channel * SLICES * own->nodes;
}

static void end_turn(const clt_transport *transport, int channel) {
  tree *own = transport->storage;
  pthread_mutex_unlock(&own->turn[channel]);
}

/* Two running sums, so that additions do not wait for each other. */
static double row_product(const int32_t *node, const float *value, int64_t count, const double *sums) {
  double even = 0, odd = 0;
  int64_t e = 0;
  for (; e + 2 <= count; e += 2) {
    even += (double)value[e] * sums[node[e]];
    odd += (double)value[e + 1] * sums[node[e + 1]];
  }
  if (e < count) {
    even += (double)value[e] * sums[node[e]];
  }
  return even + odd;
}

/* y_i = sum_e value_e sums_node(e), after the cells' values in sums have been summed over the blocks. */
static void product_of_cells(const clt_transport *transport, int channel, double *sums, double *y) {
  const tree *own = transport->storage;
  const float *value = values_of(transport, channel);
  const int64_t *start = own->start;
  clt_pyramid_sum_up(&own->pyramid, sums);
#pragma omp parallel for schedule(static) if (start[transport->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < transport->rows; i++) {
    y[i] = row_product(own->node + start[i], value + start[i], start[i + 1] - start[i], sums);
  }
}

static void tree_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  double *sums = begin_turn(transport, channel);
  memcpy(sums, x, transport->cols * sizeof *x);
  product_of_cells(transport, channel, sums, y);
  end_turn(transport, channel);
}

/* T 1: the blocks' sums of ones are their numbers of cells, clipped at the borders. */
static void tree_row_sums(const clt_transport *transport, int channel, double *sums) {
  double *ones = begin_turn(transport, channel);
  for (size_t j = 0; j < transport->cols; j++) {
    ones[j] = 1;
  }
  product_of_cells(transport, channel, ones, sums);
  end_turn(transport, channel);
}

static void scatter_slice(const clt_transport *transport, int channel, int slice, const double *y, double *partial) {
  const tree *own = transport->storage;
  const float *value = values_of(transport, channel);
  memset(partial, 0, own->nodes * sizeof *partial);
  for (size_t i = own->slice[slice]; i < own->slice[slice + 1]; i++) {
    if (y[i] == 0) {
      continue;
    }
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      partial[own->node[e]] += y[i] * (double)value[e];
    }
  }
}

static void tree_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  const tree *own = transport->storage;
  const size_t nodes = own->nodes;
  const bool share = own->start[transport->rows] >= WORTH_SHARING;
  double *partial = begin_turn(transport, channel);
#pragma omp parallel for schedule(dynamic, 1) if (share)
  for (int slice = 0; slice < SLICES; slice++) {
    scatter_slice(transport, channel, slice, y, partial + (size_t)slice * nodes);
  }
#pragma omp parallel for schedule(static) if (share)
  for (size_t n = 0; n < nodes; n++) {
    for (size_t slice = 1; slice < SLICES; slice++) {
      partial[n] += partial[slice * nodes + n];
    }
  }
  clt_pyramid_push_down(&own->pyramid, partial);
  memcpy(x, partial, transport->cols * sizeof *x);
  end_turn(transport, channel);
}

static void tree_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  const tree *own = transport->storage;
  const float *value = values_of(transport, channel);
  const size_t count = transport->rows < transport->cols ? transport->rows : transport->cols;
#pragma omp parallel for schedule(static) if (own->start[transport->rows] >= WORTH_SHARING)
  for (size_t i = 0; i < count; i++) {
    double sum = 0;
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      int level = clt_pyramid_level(&own->pyramid, own->node[e]);
      sum += own->node[e] == clt_pyramid_above(&own->pyramid, level, (int32_t)i) ? (double)value[e] : 0;
    }
    diagonal[i] = sum;
  }
}

static size_t tree_bytes(const clt_transport *transport) {
  const tree *own = transport->storage;
  size_t entries = (size_t)own->start[transport->rows];
  size_t pattern = entries * sizeof *own->node + (transport->rows + 1) * sizeof *own->start;
  return (size_t)transport->channels * (pattern + entries * sizeof *own->value);
}

static float *tree_entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL;
}

static clt_values tree_values(const clt_transport *transport, const char *source) {
  const tree *own = transport->storage;
  return (clt_values){.source = source,
                      .name = "/tree/value",
                      .rank = 2,
                      .shape = {(size_t)transport->channels, (size_t)own->start[transport->rows]},
                      .data = own->value};
}

static clt_status tree_check(const clt_transport *transport, const char *source, clt_error *error) {
  clt_values values = tree_values(transport, source);
  return clt_check_entries(&values, error);
}

/* The pattern of `entries` entries: start ascends from 0 to entries, every node is one of the pyramid's. */
static clt_status check_pattern(const tree *own, size_t rows, size_t entries, const char *source, clt_error *error) {
  for (size_t i = 0; i <= rows; i++) {
    int64_t least = i == 0 ? 0 : own->start[i - 1], most = i == 0 ? 0 : (int64_t)entries;
    least = i == rows ? (int64_t)entries : least;
    if (own->start[i] < least || own->start[i] > most) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "%s: /tree/start[%zu] is %lld; the starts ascend from 0 to the number of entries, %zu", source, i,
                      (long long)own->start[i], entries);
    }
  }
  for (size_t e = 0; e < entries; e++) {
    if (own->node[e] < 0 || (size_t)own->node[e] >= own->nodes) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: /tree/node[%zu] is %d; the grid's pyramid has the nodes 0..%zu",
                      source, e, own->node[e], own->nodes - 1);
    }
  }
  return CLT_OK;
}

/* Slices with about as many entries each. */
static void cut_slices(tree *own, size_t rows) {
  size_t row = 0;
  for (int slice = 1; slice < SLICES; slice++) {
    int64_t target = own->start[rows] / SLICES * slice;
    while (row < rows && own->start[row] < target) {
      row++;
    }
    own->slice[slice] = row;
  }
  own->slice[SLICES] = rows;
}

/* An empty tree in transport->storage. */
static clt_status begin_tree(clt_transport *transport, const char *source, clt_error *error) {
  tree *own = clt_alloc(1, sizeof *own);
  if (own == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for a tree", source);
  }
  own->pyramid = clt_pyramid_of(transport->width, transport->height);
  own->nodes = (size_t)own->pyramid.first[own->pyramid.levels];
  for (int channel = 0; channel < CLT_CHANNELS_MAX; channel++) {
    pthread_mutex_init(&own->turn[channel], NULL);
  }
  transport->storage = own;
  return CLT_OK;
}

/* Makes a tree that has its pattern and values ready for products. */
static clt_status finish_tree(clt_transport *transport, size_t rows, size_t entries, const char *source,
                              clt_error *error) {
  tree *own = transport->storage;
  clt_status status = check_pattern(own, rows, entries, source, error);
  if (status == CLT_OK) {
    status = clt_transport_set_rows(transport, rows, source, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  clt_values values = tree_values(transport, source);
  cut_slices(own, rows);
  own->scratch = clt_alloc(own->nodes, (size_t)transport->channels * SLICES * sizeof *own->scratch);
  if (own->scratch == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for products over %zu nodes", source, own->nodes);
  }
  return clt_check_finite(&values, error);
}

static void tree_destroy(clt_transport *transport) {
  tree *own = transport->storage;
  if (own == NULL) {
    return;
  }
  for (int channel = 0; channel < CLT_CHANNELS_MAX; channel++) {
    pthread_mutex_destroy(&own->turn[channel]);
  }
  free(own->start);
  free(own->node);
  free(own->value);
  free(own->scratch);
  free(own);
}

static clt_status tree_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_status status = begin_tree(transport, hdf->path, error);
  if (status != CLT_OK) {
    return status;
  }
  tree *own = transport->storage;
  clt_hdf_array start = {.name = "/tree/start", .type = H5T_NATIVE_INT64, .rank = 1, .shape = {CLT_HDF_ANY}};
  clt_hdf_array node = {.name = "/tree/node", .type = H5T_NATIVE_INT32, .rank = 1, .shape = {CLT_HDF_ANY}};
  clt_hdf_array value = {
      .name = "/tree/value", .type = H5T_NATIVE_FLOAT, .rank = 2, .shape = {(size_t)transport->channels}};
  status = clt_hdf_read(hdf, &start, error);
  own->start = start.data;
  if (status == CLT_OK) {
    status = clt_hdf_read(hdf, &node, error);
    own->node = node.data;
  }
  if (status == CLT_OK) {
    value.shape[1] = node.shape[0];
    status = clt_hdf_read(hdf, &value, error);
    own->value = value.data;
  }
  if (status != CLT_OK) {
    return status;
  }
  if (start.shape[0] < 2) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: /tree/start has %zu value(s); it has one more than there are rows",
                    hdf->path, start.shape[0]);
  }
  return finish_tree(transport, start.shape[0] - 1, node.shape[0], hdf->path, error);
}

static clt_status tree_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  const tree *own = transport->storage;
  const size_t entries = (size_t)own->start[transport->rows];
  const clt_hdf_array parts[] = {
      {.name = "/tree/start", .type = H5T_NATIVE_INT64, .rank = 1, .shape = {transport->rows + 1}, .data = own->start},
      {.name = "/tree/node", .type = H5T_NATIVE_INT32, .rank = 1, .shape = {entries}, .data = own->node},
      {.name = "/tree/value",
       .type = H5T_NATIVE_FLOAT,
       .rank = 2,
       .shape = {(size_t)transport->channels, entries},
       .data = own->value}};
  clt_status status = clt_hdf_make_group(hdf, "/tree", error);
  for (size_t part = 0; part < sizeof parts / sizeof parts[0] && status == CLT_OK; part++) {
    status = clt_hdf_write(hdf, &parts[part], error);
  }
  return status;
}

const clt_kind clt_kind_tree = {.name = "tree",
                                .apply = tree_apply,
                                .apply_transposed = tree_apply_transposed,
                                .diagonal = tree_diagonal,
                                .row_sums = tree_row_sums,
                                .bytes = tree_bytes,
                                .entries = tree_entries,
                                .check = tree_check,
                                .load = tree_load,
                                .save = tree_save,
                                .destroy = tree_destroy};

/* A copy of count elements. */
static void *copy_of(const void *from, size_t count, size_t size) {
  void *copy = clt_alloc(count, size);
  if (copy != NULL && count > 0) {
    memcpy(copy, from, count * size);
  }
  return copy;
}

static clt_status copy_tree(clt_transport *transport, size_t rows, const int64_t *start, const int32_t *node,
                            const float *value, clt_error *error) {
  static const char source[] = "a tree transport";
  const int64_t most = INT64_MAX / (int64_t)(CLT_CHANNELS_MAX * sizeof *value);
  if (rows < 1 || start[rows] < 0 || start[rows] > most) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %zu rows with %lld entries", source, rows,
                    rows < 1 ? 0LL : (long long)start[rows]);
  }
  clt_status status = begin_tree(transport, source, error);
  if (status != CLT_OK) {
    return status;
  }
  tree *own = transport->storage;
  const size_t entries = (size_t)start[rows];
  own->start = copy_of(start, rows + 1, sizeof *start);
  own->node = copy_of(node, entries, sizeof *node);
  own->value = copy_of(value, entries * (size_t)transport->channels, sizeof *value);
  if (own->start == NULL || own->node == NULL || own->value == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for %zu entries", source, entries);
  }
  return finish_tree(transport, rows, entries, source, error);
}

clt_status clt_transport_create_tree(int width, int height, int channels, size_t rows, const int64_t *start,
                                     const int32_t *node, const float *value, clt_transport **out, clt_error *error) {
  clt_status status = clt_transport_begin(&clt_kind_tree, width, height, channels, "a tree transport", out, error);
  if (status == CLT_OK) {
    status = copy_tree(*out, rows, start, node, value, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_keep_black(*out, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(*out);
    *out = NULL;
  }
  return status;
}
