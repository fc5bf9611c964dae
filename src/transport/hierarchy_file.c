/* Making hierarchy storage, and its part of a file. */
#include <stdlib.h>

#include "base/memory.h"
#include "transport/check.h"
#include "transport/hierarchy_factors.h"

static clt_values values_of(const clt_transport *transport, const char *source, const char *name, size_t count,
                            const float *data) {
  return (clt_values){
      .source = source, .name = name, .rank = 2, .shape = {(size_t)transport->channels, count}, .data = data};
}

clt_status clt_hierarchic_check(const clt_transport *transport, const char *source, clt_error *error) {
  const clt_hierarchy_storage *own = transport->storage;
  const size_t cells = transport->cols;
  const clt_values all[] = {values_of(transport, source, "/hierarchy/scale", cells, own->scale),
                            values_of(transport, source, "/hierarchy/gather", cells, own->gather),
                            values_of(transport, source, "/hierarchy/own", cells, own->own),
                            values_of(transport, source, "/hierarchy/flood", cells, own->flood),
                            values_of(transport, source, "/hierarchy/value", (size_t)own->start[cells], own->value)};
  clt_status status = clt_hierarchic_check_factors(transport, source, error);
  for (size_t k = 0; k < sizeof all / sizeof all[0] && status == CLT_OK; k++) {
    status = clt_check_finite(&all[k], error);
  }
  return status;
}

/* Every cell lies in one leaf, and no leaf is larger than they may be. */
static clt_status check_leaves(const clt_transport *transport, const char *source, clt_error *error) {
  const clt_hierarchy_storage *own = transport->storage;
  unsigned char *seen = clt_alloc(transport->cols, 1);
  if (seen == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory to check the leaves of %zu cells", source, transport->cols);
  }
  size_t covered = 0, bad = own->leaves;
  for (size_t k = 0; k < own->leaves && bad == own->leaves; k++) {
    const clt_leaf leaf = own->leaf[k];
    const bool fits = leaf.width >= 1 && leaf.height >= 1 && leaf.width <= CLT_LEAF_SIDE_MAX &&
                      leaf.height <= CLT_LEAF_SIDE_MAX && leaf.x >= 0 && leaf.y >= 0 &&
                      leaf.x <= transport->width - leaf.width && leaf.y <= transport->height - leaf.height;
    bad = fits ? bad : k;
    for (int32_t i = 0; fits && i < leaf.width * leaf.height; i++) {
      unsigned char *cell =
          &seen[(size_t)(leaf.y + i / leaf.width) * (size_t)transport->width + (size_t)(leaf.x + i % leaf.width)];
      bad = *cell != 0 ? k : bad;
      covered += *cell == 0;
      *cell = 1;
    }
  }
  free(seen);
  if (bad < own->leaves || covered != transport->cols) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "%s: /hierarchy/leaf[%zu]: the leaves, at most %d cells a side, share out the %d x %d cells without "
        "overlap",
        source, bad < own->leaves ? bad : own->leaves, CLT_LEAF_SIDE_MAX, transport->width, transport->height);
  }
  return CLT_OK;
}

clt_status clt_hierarchic_begin(clt_transport *transport, size_t leaves, size_t rank, const char *source,
                                clt_error *error) {
  clt_hierarchy_storage *own = clt_alloc(1, sizeof *own);
  if (own == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for a hierarchy", source);
  }
  own->leaves = leaves;
  own->rank = rank;
  for (int channel = 0; channel < CLT_CHANNELS_MAX; channel++) {
    pthread_mutex_init(&own->turn[channel], NULL);
  }
  transport->storage = own;
  return clt_transport_set_rows(transport, transport->cols, source, error);
}

clt_status clt_hierarchic_finish(clt_transport *transport, size_t entries, const char *source, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  clt_status status = check_leaves(transport, source, error);
  if (status == CLT_OK) {
    status = clt_check_near(source, "/hierarchy", own->start, own->cell, transport->cols, entries, error);
  }
  if (status == CLT_OK) {
    status = clt_near_stream_make(transport->cols, (size_t)transport->channels, own->start, own->cell, own->value, NULL,
                                  &own->near, error);
  }
  if (status == CLT_OK) {
    status = clt_leaf_spans_make(own->leaf, own->leaves, transport->width, transport->height, &own->spans, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  own->scratch = clt_alloc(clt_hierarchic_scratch(own), (size_t)transport->channels * sizeof *own->scratch);
  if (own->scratch == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for products over %zu leaves", source, own->leaves);
  }
  return clt_hierarchic_check(transport, source, error);
}

void clt_hierarchic_destroy(clt_transport *transport) {
  clt_hierarchy_storage *own = transport->storage;
  if (own == NULL) {
    return;
  }
  for (int channel = 0; channel < CLT_CHANNELS_MAX; channel++) {
    pthread_mutex_destroy(&own->turn[channel]);
  }
  free(own->leaf);
  clt_leaf_rows_finish(&own->left);
  clt_leaf_rows_finish(&own->right);
  free(own->core);
  free(own->scale);
  free(own->gather);
  free(own->own);
  free(own->flood);
  free(own->start);
  free(own->cell);
  free(own->value);
  clt_near_stream_finish(&own->near);
  clt_leaf_spans_finish(&own->spans);
  free(own->scratch);
  free(own);
}

/* The parts of the group but the factors; sizes are what the storage says. */
enum { LEAF, SCALE, GATHER, OWN, FLOOD, START, CELL, VALUE, ERROR, PARTS };
static void list_parts(const clt_transport *transport, size_t entries, clt_hdf_array parts[PARTS]) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t cells = transport->cols, channels = (size_t)transport->channels;
  parts[LEAF] = (clt_hdf_array){"/hierarchy/leaf", H5T_NATIVE_INT32, 2, {own->leaves, 4}, own->leaf};
  parts[SCALE] = (clt_hdf_array){"/hierarchy/scale", H5T_NATIVE_FLOAT, 2, {channels, cells}, own->scale};
  parts[GATHER] = (clt_hdf_array){"/hierarchy/gather", H5T_NATIVE_FLOAT, 2, {channels, cells}, own->gather};
  parts[OWN] = (clt_hdf_array){"/hierarchy/own", H5T_NATIVE_FLOAT, 2, {channels, cells}, own->own};
  parts[FLOOD] = (clt_hdf_array){"/hierarchy/flood", H5T_NATIVE_FLOAT, 2, {channels, cells}, own->flood};
  parts[START] = (clt_hdf_array){"/hierarchy/start", H5T_NATIVE_INT64, 1, {cells + 1}, own->start};
  parts[CELL] = (clt_hdf_array){"/hierarchy/cell", H5T_NATIVE_INT32, 1, {entries}, own->cell};
  parts[VALUE] = (clt_hdf_array){"/hierarchy/value", H5T_NATIVE_FLOAT, 2, {channels, entries}, own->value};
  parts[ERROR] = (clt_hdf_array){"/hierarchy/error", H5T_NATIVE_DOUBLE, 1, {1}, &own->error};
}

static clt_status read_error(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  clt_hdf_array part = {"/hierarchy/error", H5T_NATIVE_DOUBLE, 1, {1}, NULL};
  clt_status status = clt_hdf_read(hdf, &part, error);
  const double *value = part.data;
  if (status == CLT_OK && !(value[0] >= 0 && value[0] <= DBL_MAX)) {
    status = clt_fail(error, CLT_BAD_INPUT, "%s: /hierarchy/error[0] is %g; an error is finite and not negative",
                      hdf->path, value[0]);
  }
  own->error = status == CLT_OK ? value[0] : 0;
  free(part.data);
  return status;
}

/* The number of leaves comes with the first part. */
static clt_status read_parts(clt_transport *transport, const clt_hdf *hdf, size_t *entries, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  void **const homes[ERROR] = {(void **)&own->leaf,  (void **)&own->scale, (void **)&own->gather, (void **)&own->own,
                               (void **)&own->flood, (void **)&own->start, (void **)&own->cell,   (void **)&own->value};
  *entries = CLT_HDF_ANY;
  for (int part = 0; part < ERROR; part++) {
    clt_hdf_array parts[PARTS];
    list_parts(transport, *entries, parts);
    if (part == LEAF) {
      parts[LEAF].shape[0] = CLT_HDF_ANY;
    }
    clt_status status = clt_hdf_read(hdf, &parts[part], error);
    *homes[part] = parts[part].data;
    if (status != CLT_OK) {
      return status;
    }
    own->leaves = part == LEAF ? parts[LEAF].shape[0] : own->leaves;
    *entries = part == CELL ? parts[CELL].shape[0] : *entries;
  }
  const clt_status status = clt_hierarchic_load_factors(transport, hdf, error);
  return status == CLT_OK ? read_error(transport, hdf, error) : status;
}

clt_status clt_hierarchic_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  size_t entries = 0;
  clt_status status = clt_hierarchic_begin(transport, 0, 0, hdf->path, error);
  if (status == CLT_OK) {
    status = read_parts(transport, hdf, &entries, error);
  }
  return status == CLT_OK ? clt_hierarchic_finish(transport, entries, hdf->path, error) : status;
}

clt_status clt_hierarchic_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  const clt_hierarchy_storage *own = transport->storage;
  clt_hdf_array parts[PARTS];
  list_parts(transport, (size_t)own->start[transport->cols], parts);
  clt_status status = clt_hdf_make_group(hdf, "/hierarchy", error);
  for (int part = 0; part < PARTS && status == CLT_OK; part++) {
    status = clt_hdf_write(hdf, &parts[part], error);
  }
  return status == CLT_OK ? clt_hierarchic_save_factors(transport, hdf, error) : status;
}
