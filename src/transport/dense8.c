/* Dense storage in bytes: int8 codes in blocks of 32 along a row with a scale each, and an offset for every row that
 * gives its entries off the diagonal their exact sum (NUMERICS section 3). The diagonal stays in float. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "transport/check.h"
#include "transport/kernels.h"
#include "transport/packed.h"

enum { LARGEST_CODE = 127 };

typedef struct dense8 {
  clt_packed packed;
  int8_t *code; /* channels x rows x cols; 0 on the diagonal */
  float *scale; /* channels x rows x blocks */
  const clt_byte_kernels *kernels;
} dense8;

static size_t blocks_of(const clt_transport *transport) {
  return (transport->cols + CLT_BLOCK - 1) / CLT_BLOCK;
}

static size_t row_index(const clt_transport *transport, int channel, size_t row) {
  return (size_t)channel * transport->rows + row;
}

static int8_t *codes_of(const clt_transport *transport, int channel, size_t row) {
  const dense8 *own = transport->storage;
  return own->code + row_index(transport, channel, row) * transport->cols;
}

static float *scales_of(const clt_transport *transport, int channel, size_t row) {
  const dense8 *own = transport->storage;
  return own->scale + row_index(transport, channel, row) * blocks_of(transport);
}

static double dot(const clt_transport *transport, int channel, size_t row, size_t first, size_t count, const float *x) {
  const dense8 *own = transport->storage;
  return own->kernels->dot(codes_of(transport, channel, row) + first,
                           scales_of(transport, channel, row) + first / CLT_BLOCK, x, count);
}

static void add(const clt_transport *transport, int channel, const size_t row[CLT_PACKED_GROUP],
                const float y[CLT_PACKED_GROUP], size_t first, size_t count, float *x) {
  const dense8 *own = transport->storage;
  const int8_t *code[CLT_PACKED_GROUP];
  const float *scale[CLT_PACKED_GROUP];
  for (int k = 0; k < CLT_PACKED_GROUP; k++) {
    code[k] = codes_of(transport, channel, row[k]) + first;
    scale[k] = scales_of(transport, channel, row[k]) + first / CLT_BLOCK;
  }
  own->kernels->add(code, scale, y, count, x);
}

static void decode(const clt_transport *transport, int channel, size_t row, double *values) {
  const int8_t *code = codes_of(transport, channel, row);
  const float *scale = scales_of(transport, channel, row);
  for (size_t j = 0; j < transport->cols; j++) {
    values[j] = (double)scale[j / CLT_BLOCK] * code[j];
  }
}

static const clt_packed_form form = {.dot = dot, .add = add, .decode = decode};

/* The sum of a row's codes, without offset and diagonal. */
static double code_sum(const clt_transport *transport, int channel, size_t row) {
  const int8_t *code = codes_of(transport, channel, row);
  const float *scale = scales_of(transport, channel, row);
  double sum = 0;
  for (size_t first = 0; first < transport->cols; first += CLT_BLOCK) {
    int codes = 0;
    for (size_t j = first; j < transport->cols && j < first + CLT_BLOCK; j++) {
      codes += code[j];
    }
    sum += (double)scale[first / CLT_BLOCK] * codes;
  }
  return sum;
}

/* How many of a row's entries are off the diagonal. */
static size_t off_diagonal(const clt_transport *transport, size_t row) {
  return transport->cols - (row < clt_packed_diagonal_count(transport) ? 1 : 0);
}

static void dense8_row_sums(const clt_transport *transport, int channel, double *sums) {
  const dense8 *own = transport->storage;
  const size_t own_cells = clt_packed_diagonal_count(transport);
#pragma omp parallel for schedule(static) if (transport->rows * transport->cols >= CLT_WORTH_SHARING)
  for (size_t i = 0; i < transport->rows; i++) {
    const double offset = (double)own->packed.offset[row_index(transport, channel, i)];
    sums[i] = code_sum(transport, channel, i) + offset * (double)off_diagonal(transport, i);
    sums[i] += i < own_cells ? clt_packed_diagonal_entry(transport, channel, i) : 0;
  }
}

static size_t dense8_bytes(const clt_transport *transport) {
  const size_t row = transport->cols + (blocks_of(transport) + 1) * sizeof(float);
  return (size_t)transport->channels * (transport->rows * row + clt_packed_diagonal_count(transport) * sizeof(float));
}

static clt_status begin(clt_transport *transport, clt_error *error) {
  dense8 *own = clt_alloc(1, sizeof *own);
  if (own == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for a dense8 transport");
  }
  own->packed.form = &form;
  own->kernels = clt_byte_choose();
  transport->storage = own;
  return CLT_OK;
}

static clt_status dense8_reserve(clt_transport *transport, clt_error *error) {
  clt_status status = begin(transport, error);
  if (status != CLT_OK) {
    return status;
  }
  dense8 *own = transport->storage;
  const size_t channels = (size_t)transport->channels;
  own->code = clt_alloc(transport->rows * transport->cols, channels);
  own->scale = clt_alloc(transport->rows * blocks_of(transport), channels * sizeof *own->scale);
  own->packed.offset = clt_alloc(transport->rows, channels * sizeof(float));
  own->packed.diagonal = clt_alloc(clt_packed_diagonal_count(transport), channels * sizeof(float));
  return own->code != NULL && own->scale != NULL && own->packed.offset != NULL && own->packed.diagonal != NULL
             ? CLT_OK
             : clt_transport_too_large(transport, dense8_bytes(transport), error);
}

/* One block of codes; the diagonal's place is left out. */
static void put_block(const double *values, size_t first, size_t count, size_t row, int8_t *code, float *scale) {
  double largest = 0;
  for (size_t j = first; j < first + count; j++) {
    largest = j != row && fabs(values[j]) > largest ? fabs(values[j]) : largest;
  }
  *scale = (float)(largest / LARGEST_CODE);
  for (size_t j = first; j < first + count; j++) {
    double nearest = *scale > 0 ? nearbyint(values[j] / (double)*scale) : 0;
    code[j] = j == row ? 0 : (int8_t)fmin(fmax(nearest, -LARGEST_CODE), LARGEST_CODE);
  }
}

static void dense8_put_row(clt_transport *transport, int channel, size_t row, const double *values) {
  dense8 *own = transport->storage;
  const size_t cols = transport->cols, count = off_diagonal(transport, row);
  double sum = 0;
  for (size_t first = 0; first < cols; first += CLT_BLOCK) {
    const size_t width = cols - first < CLT_BLOCK ? cols - first : CLT_BLOCK;
    put_block(values, first, width, row, codes_of(transport, channel, row),
              scales_of(transport, channel, row) + first / CLT_BLOCK);
  }
  for (size_t j = 0; j < cols; j++) {
    sum += j != row ? values[j] : 0;
  }
  const double missing = sum - code_sum(transport, channel, row);
  own->packed.offset[row_index(transport, channel, row)] = count > 0 ? (float)(missing / (double)count) : 0;
  clt_packed_put_diagonal(transport, channel, row, values);
}

static clt_status dense8_check(const clt_transport *transport, const char *source, clt_error *error) {
  return clt_check_rows(transport, source, "/dense8", error);
}

/* The parts of the group. */
enum { CODE, SCALE, OFFSET, DIAGONAL, PARTS };
static void list_parts(const clt_transport *transport, clt_hdf_array parts[PARTS]) {
  const dense8 *own = transport->storage;
  const size_t channels = (size_t)transport->channels, rows = transport->rows;
  parts[CODE] = (clt_hdf_array){.name = "/dense8/code",
                                .type = H5T_NATIVE_INT8,
                                .rank = 3,
                                .shape = {channels, rows, transport->cols},
                                .data = own->code};
  parts[SCALE] = (clt_hdf_array){.name = "/dense8/scale",
                                 .type = H5T_NATIVE_FLOAT,
                                 .rank = 3,
                                 .shape = {channels, rows, blocks_of(transport)},
                                 .data = own->scale};
  parts[OFFSET] = (clt_hdf_array){.name = "/dense8/offset",
                                  .type = H5T_NATIVE_FLOAT,
                                  .rank = 2,
                                  .shape = {channels, rows},
                                  .data = own->packed.offset};
  parts[DIAGONAL] = (clt_hdf_array){.name = "/dense8/diagonal",
                                    .type = H5T_NATIVE_FLOAT,
                                    .rank = 2,
                                    .shape = {channels, clt_packed_diagonal_count(transport)},
                                    .data = own->packed.diagonal};
}

static clt_status load_parts(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  dense8 *own = transport->storage;
  clt_hdf_array parts[PARTS];
  list_parts(transport, parts);
  parts[CODE].shape[1] = CLT_HDF_ANY;
  clt_status status = clt_hdf_read(hdf, &parts[CODE], error);
  own->code = parts[CODE].data;
  if (status == CLT_OK) {
    status = clt_transport_set_rows(transport, parts[CODE].shape[1], hdf->path, error);
  }
  void **const places[PARTS] = {[SCALE] = (void **)&own->scale,
                                [OFFSET] = (void **)&own->packed.offset,
                                [DIAGONAL] = (void **)&own->packed.diagonal};
  list_parts(transport, parts);
  for (int part = SCALE; part < PARTS && status == CLT_OK; part++) {
    status = clt_hdf_read(hdf, &parts[part], error);
    *places[part] = parts[part].data;
  }
  return status;
}

static clt_status dense8_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_status status = begin(transport, error);
  if (status == CLT_OK) {
    status = load_parts(transport, hdf, error);
  }
  for (int c = 0; c < transport->channels && status == CLT_OK; c++) {
    for (size_t i = 0; i < clt_packed_diagonal_count(transport) && status == CLT_OK; i++) {
      status = codes_of(transport, c, i)[i] != 0 ? clt_packed_refuse_diagonal(hdf->path, "/dense8/code", c, i, error)
                                                 : CLT_OK;
    }
  }
  return status;
}

static clt_status dense8_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hdf_array parts[PARTS];
  list_parts(transport, parts);
  clt_status status = clt_hdf_make_group(hdf, "/dense8", error);
  for (int part = 0; part < PARTS && status == CLT_OK; part++) {
    status = clt_hdf_write(hdf, &parts[part], error);
  }
  return status;
}

static void dense8_destroy(clt_transport *transport) {
  dense8 *own = transport->storage;
  if (own != NULL) {
    free(own->code);
    free(own->scale);
    free(own->packed.offset);
    free(own->packed.diagonal);
    free(own);
  }
}

const clt_kind clt_kind_dense8 = {.name = "dense8",
                                  .apply = clt_packed_apply,
                                  .apply_transposed = clt_packed_apply_transposed,
                                  .diagonal = clt_packed_diagonal,
                                  .row_sums = dense8_row_sums,
                                  .bytes = dense8_bytes,
                                  .entries = clt_packed_entries,
                                  .row = clt_packed_row,
                                  .most = 1e30, /* a span of such entries still adds up in float */
                                  .reserve = dense8_reserve,
                                  .put_row = dense8_put_row,
                                  .check = dense8_check,
                                  .load = dense8_load,
                                  .save = dense8_save,
                                  .destroy = dense8_destroy};
