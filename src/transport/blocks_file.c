/* Making blocks storage, from arrays and from a file. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/blocks.h"
#include "transport/check.h"

static clt_values values_of(const clt_transport *transport, const char *source, bool near) {
  const clt_block_storage *own = transport->storage;
  const size_t channels = (size_t)transport->channels;
  return near ? (clt_values){.source = source,
                             .name = "/blocks/value",
                             .rank = 2,
                             .shape = {channels, (size_t)own->start[transport->rows]},
                             .data = own->value}
              : (clt_values){.source = source,
                             .name = "/blocks/column",
                             .rank = 3,
                             .shape = {channels, own->count, transport->cols},
                             .data = own->column};
}

clt_status clt_blocks_check(const clt_transport *transport, const char *source, clt_error *error) {
  clt_values near = values_of(transport, source, true), columns = values_of(transport, source, false);
  clt_status status = clt_check_finite(&near, error);
  return status == CLT_OK ? clt_check_finite(&columns, error) : status;
}

/* Every cell lies in one of the blocks and has a flux that can be one. */
static clt_status check_cells(const clt_block_storage *own, size_t cells, const char *source, clt_error *error) {
  if (own->count == 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: /blocks/column has no block; there is one at least", source);
  }
  for (size_t j = 0; j < cells; j++) {
    if (own->block[j] < 0 || (size_t)own->block[j] >= own->count) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: /blocks/block[%zu] is %d; there are the blocks 0..%zu", source, j,
                      own->block[j], own->count - 1);
    }
    if (!(own->flux[j] >= 0 && own->flux[j] <= FLT_MAX)) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: /blocks/flux[%zu] is %g; a flux is finite and not negative", source, j,
                      (double)own->flux[j]);
    }
  }
  return CLT_OK;
}

static clt_status begin(clt_transport *transport, size_t count, const char *source, clt_error *error) {
  clt_block_storage *own = clt_alloc(1, sizeof *own);
  if (own == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for blocks", source);
  }
  own->count = count;
  for (int channel = 0; channel < CLT_CHANNELS_MAX; channel++) {
    pthread_mutex_init(&own->turn[channel], NULL);
  }
  transport->storage = own;
  return clt_transport_set_rows(transport, transport->cols, source, error);
}

/* Shares out the cells into runs; behind them stands one without cells. */
static clt_status find_runs(clt_block_storage *own, size_t cells, const char *source, clt_error *error) {
  size_t count = 0;
  for (int pass = 0; pass < 2; pass++) { /* counts them, then notes them */
    count = 0;
    for (size_t slice = 0; slice < CLT_SLICES; slice++) {
      const size_t first = clt_slice_first(cells, slice), end = clt_slice_first(cells, slice + 1);
      own->first_run[slice] = count;
      for (size_t j = first; j < end; j++) {
        if (j == first || own->block[j] != own->block[j - 1]) {
          if (pass == 1) {
            own->run[count] = (clt_run){(int32_t)j, own->block[j]};
          }
          count++;
        }
      }
    }
    own->first_run[CLT_SLICES] = count;
    if (pass == 0 && (own->run = clt_alloc(count + 1, sizeof *own->run)) == NULL) {
      return clt_fail(error, CLT_FAILED, "%s: no memory for the blocks of %zu cells", source, cells);
    }
  }
  own->run[count] = (clt_run){(int32_t)cells, 0};
  return CLT_OK;
}

/* Makes storage that has all its arrays ready for products. */
static clt_status finish(clt_transport *transport, size_t entries, const char *source, clt_error *error) {
  clt_block_storage *own = transport->storage;
  const size_t cells = transport->cols, channels = (size_t)transport->channels;
  clt_status status = check_cells(own, cells, source, error);
  if (status == CLT_OK) {
    status = clt_check_near(source, "/blocks", own->start, own->cell, cells, entries, error);
  }
  own->own = clt_alloc(cells, channels * sizeof *own->own);
  if (status == CLT_OK && own->own == NULL) {
    status = clt_fail(error, CLT_FAILED, "%s: no memory for %zu cells", source, cells);
  }
  if (status == CLT_OK) {
    status = clt_near_stream_make(cells, channels, own->start, own->cell, own->value, own->own, &own->near, error);
  }
  if (status == CLT_OK) {
    status = find_runs(own, cells, source, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  own->inverse = clt_alloc(own->count, sizeof *own->inverse);
  own->scratch = clt_alloc(clt_block_scratch(own->count), channels * sizeof *own->scratch);
  if (own->inverse == NULL || own->scratch == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for products with %zu blocks", source, own->count);
  }
  for (size_t j = 0; j < cells; j++) {
    own->inverse[own->block[j]] += (double)own->flux[j];
  }
  for (size_t b = 0; b < own->count; b++) {
    own->inverse[b] = own->inverse[b] > 0 ? 1 / own->inverse[b] : 0;
  }
  return clt_blocks_check(transport, source, error);
}

void clt_blocks_destroy(clt_transport *transport) {
  clt_block_storage *own = transport->storage;
  if (own == NULL) {
    return;
  }
  for (int channel = 0; channel < CLT_CHANNELS_MAX; channel++) {
    pthread_mutex_destroy(&own->turn[channel]);
  }
  free(own->block);
  free(own->flux);
  free(own->column);
  free(own->start);
  free(own->cell);
  free(own->value);
  free(own->own);
  clt_near_stream_finish(&own->near);
  free(own->run);
  free(own->inverse);
  free(own->scratch);
  free(own);
}

/* The parts of the group. Sizes are what the storage says; `entries` of near. */
enum { BLOCK, FLUX, COLUMN, START, CELL, VALUE, PARTS };
static void list_parts(const clt_transport *transport, size_t entries, clt_hdf_array parts[PARTS]) {
  const clt_block_storage *own = transport->storage;
  const size_t cells = transport->cols, channels = (size_t)transport->channels;
  parts[BLOCK] = (clt_hdf_array){"/blocks/block", H5T_NATIVE_INT32, 1, {cells}, own->block};
  parts[FLUX] = (clt_hdf_array){"/blocks/flux", H5T_NATIVE_FLOAT, 1, {cells}, own->flux};
  parts[COLUMN] = (clt_hdf_array){"/blocks/column", H5T_NATIVE_FLOAT, 3, {channels, own->count, cells}, own->column};
  parts[START] = (clt_hdf_array){"/blocks/start", H5T_NATIVE_INT64, 1, {cells + 1}, own->start};
  parts[CELL] = (clt_hdf_array){"/blocks/cell", H5T_NATIVE_INT32, 1, {entries}, own->cell};
  parts[VALUE] = (clt_hdf_array){"/blocks/value", H5T_NATIVE_FLOAT, 2, {channels, entries}, own->value};
}

static clt_status read_parts(clt_transport *transport, const clt_hdf *hdf, size_t *entries, clt_error *error) {
  clt_block_storage *own = transport->storage;
  void **const homes[PARTS] = {(void **)&own->block, (void **)&own->flux, (void **)&own->column,
                               (void **)&own->start, (void **)&own->cell, (void **)&own->value};
  clt_hdf_array parts[PARTS];
  list_parts(transport, CLT_HDF_ANY, parts);
  parts[COLUMN].shape[1] = CLT_HDF_ANY;
  for (int part = 0; part < PARTS; part++) {
    parts[VALUE].shape[1] = part == VALUE ? parts[CELL].shape[0] : CLT_HDF_ANY;
    clt_status status = clt_hdf_read(hdf, &parts[part], error);
    *homes[part] = parts[part].data;
    if (status != CLT_OK) {
      return status;
    }
  }
  own->count = parts[COLUMN].shape[1];
  *entries = parts[CELL].shape[0];
  return CLT_OK;
}

clt_status clt_blocks_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  size_t entries = 0;
  clt_status status = begin(transport, 0, hdf->path, error);
  if (status == CLT_OK) {
    status = read_parts(transport, hdf, &entries, error);
  }
  return status == CLT_OK ? finish(transport, entries, hdf->path, error) : status;
}

clt_status clt_blocks_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  const clt_block_storage *own = transport->storage;
  clt_hdf_array parts[PARTS];
  list_parts(transport, (size_t)own->start[transport->rows], parts);
  clt_status status = clt_hdf_make_group(hdf, "/blocks", error);
  for (int part = 0; part < PARTS && status == CLT_OK; part++) {
    status = clt_hdf_write(hdf, &parts[part], error);
  }
  return status;
}

/* A copy of count elements. */
static void *copy_of(const void *from, size_t count, size_t size) {
  void *copy = clt_alloc(count, size);
  if (copy != NULL && count > 0) {
    memcpy(copy, from, count * size);
  }
  return copy;
}

static clt_status copy_parts(clt_transport *transport, const clt_block_parts *parts, clt_error *error) {
  static const char source[] = "a transport of blocks";
  const size_t cells = transport->cols, channels = (size_t)transport->channels;
  const int64_t entries = parts->start[cells], most = INT64_MAX / (int64_t)(CLT_CHANNELS_MAX * sizeof *parts->value);
  if (parts->count < 1 || (size_t)parts->count > cells || entries < 0 || entries > most) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %d blocks and %lld near entries for %zu cells", source, parts->count,
                    (long long)entries, cells);
  }
  clt_status status = begin(transport, (size_t)parts->count, source, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_block_storage *own = transport->storage;
  own->block = copy_of(parts->block, cells, sizeof *own->block);
  own->flux = copy_of(parts->flux, cells, sizeof *own->flux);
  own->column = copy_of(parts->column, channels * own->count * cells, sizeof *own->column);
  own->start = copy_of(parts->start, cells + 1, sizeof *own->start);
  own->cell = copy_of(parts->cell, (size_t)entries, sizeof *own->cell);
  own->value = copy_of(parts->value, channels * (size_t)entries, sizeof *own->value);
  if (own->block == NULL || own->flux == NULL || own->column == NULL || own->start == NULL || own->cell == NULL ||
      own->value == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for %zu blocks over %zu cells", source, own->count, cells);
  }
  return finish(transport, (size_t)entries, source, error);
}

clt_status clt_transport_create_blocks(int width, int height, int channels, const clt_block_parts *parts,
                                       clt_transport **out, clt_error *error) {
  clt_status status =
      clt_transport_begin(&clt_kind_blocks, width, height, channels, "a transport of blocks", out, error);
  if (status == CLT_OK) {
    status = copy_parts(*out, parts, error);
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
