/* Dense storage in half precision: fp16 codes with a power of two for every row, which brings its largest entry off the
 * diagonal to 2^14..2^15, so that entries down to 2^-29 of that are normal numbers. The diagonal stays in float. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "transport/check.h"
#include "transport/kernels.h"
#include "transport/packed.h"

typedef struct dense16 {
  clt_packed packed;
  uint16_t *code; /* channels x rows x cols; 0 on the diagonal */
  float *scale;   /* channels x rows */
  const clt_half_kernels *kernels;
} dense16;

static size_t row_index(const clt_transport *transport, int channel, size_t row) {
  return (size_t)channel * transport->rows + row;
}

static uint16_t *codes_of(const clt_transport *transport, int channel, size_t row) {
  const dense16 *own = transport->storage;
  return own->code + row_index(transport, channel, row) * transport->cols;
}

static double scale_of(const clt_transport *transport, int channel, size_t row) {
  const dense16 *own = transport->storage;
  return (double)own->scale[row_index(transport, channel, row)];
}

static double dot(const clt_transport *transport, int channel, size_t row, size_t first, size_t count, const float *x) {
  const dense16 *own = transport->storage;
  return scale_of(transport, channel, row) * own->kernels->dot(codes_of(transport, channel, row) + first, x, count);
}

static void add(const clt_transport *transport, int channel, const size_t row[CLT_PACKED_GROUP],
                const float y[CLT_PACKED_GROUP], size_t first, size_t count, float *x) {
  const dense16 *own = transport->storage;
  const uint16_t *code[CLT_PACKED_GROUP];
  for (int k = 0; k < CLT_PACKED_GROUP; k++) {
    code[k] = codes_of(transport, channel, row[k]) + first;
  }
  own->kernels->add(code, y, count, x);
}

static void decode(const clt_transport *transport, int channel, size_t row, double *values) {
  const uint16_t *code = codes_of(transport, channel, row);
  const double scale = scale_of(transport, channel, row);
  for (size_t j = 0; j < transport->cols; j++) {
    values[j] = scale * (double)clt_half_value(code[j]);
  }
}

static const clt_packed_form form = {.dot = dot, .row_factor = scale_of, .add = add, .decode = decode};

static void dense16_row_sums(const clt_transport *transport, int channel, double *sums) {
  const uint16_t *code = codes_of(transport, channel, 0);
  const size_t cols = transport->cols, own_cells = clt_packed_diagonal_count(transport);
#pragma omp parallel for schedule(static) if (transport->rows * cols >= CLT_WORTH_SHARING)
  for (size_t i = 0; i < transport->rows; i++) {
    double sum = 0;
    for (size_t j = 0; j < cols; j++) {
      sum += (double)clt_half_value(code[i * cols + j]);
    }
    sums[i] = scale_of(transport, channel, i) * sum;
    sums[i] += i < own_cells ? clt_packed_diagonal_entry(transport, channel, i) : 0;
  }
}

static size_t dense16_bytes(const clt_transport *transport) {
  const size_t channels = (size_t)transport->channels;
  return channels * (transport->rows * (transport->cols * sizeof(uint16_t) + sizeof(float)) +
                     clt_packed_diagonal_count(transport) * sizeof(float));
}

static clt_status begin(clt_transport *transport, clt_error *error) {
  dense16 *own = clt_alloc(1, sizeof *own);
  if (own == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for a dense16 transport");
  }
  own->packed.form = &form;
  own->kernels = clt_half_choose();
  transport->storage = own;
  return CLT_OK;
}

static clt_status dense16_reserve(clt_transport *transport, clt_error *error) {
  clt_status status = begin(transport, error);
  if (status != CLT_OK) {
    return status;
  }
  dense16 *own = transport->storage;
  const size_t channels = (size_t)transport->channels;
  own->code = clt_alloc(transport->rows * transport->cols, channels * sizeof *own->code);
  own->scale = clt_alloc(transport->rows, channels * sizeof *own->scale);
  own->packed.diagonal = clt_alloc(clt_packed_diagonal_count(transport), channels * sizeof(float));
  return own->code != NULL && own->scale != NULL && own->packed.diagonal != NULL
             ? CLT_OK
             : clt_transport_too_large(transport, dense16_bytes(transport), error);
}

/* The power of two that brings the largest entry off the diagonal to 2^14..2^15, as far as a float can say it. */
static double choose_scale(const double *values, size_t cols, size_t row) {
  double largest = 0;
  for (size_t j = 0; j < cols; j++) {
    largest = j != row && fabs(values[j]) > largest ? fabs(values[j]) : largest;
  }
  int exponent = 0;
  frexp(largest, &exponent);
  return largest > 0 ? ldexp(1, exponent - 15 > -126 ? exponent - 15 : -126) : 1;
}

static void dense16_put_row(clt_transport *transport, int channel, size_t row, const double *values) {
  dense16 *own = transport->storage;
  uint16_t *code = codes_of(transport, channel, row);
  const double scale = choose_scale(values, transport->cols, row);
  own->scale[row_index(transport, channel, row)] = (float)scale;
  for (size_t j = 0; j < transport->cols; j++) {
    code[j] = j == row ? 0 : clt_half_code((float)(values[j] / scale));
  }
  clt_packed_put_diagonal(transport, channel, row, values);
}

static clt_status dense16_check(const clt_transport *transport, const char *source, clt_error *error) {
  return clt_check_rows(transport, source, "/dense16", error);
}

/* The parts of the group; half says what HDF5 calls a half. */
enum { CODE, SCALE, DIAGONAL, PARTS };
static void list_parts(const clt_transport *transport, hid_t half, clt_hdf_array parts[PARTS]) {
  const dense16 *own = transport->storage;
  const size_t channels = (size_t)transport->channels, rows = transport->rows;
  parts[CODE] = (clt_hdf_array){
      .name = "/dense16/value", .type = half, .rank = 3, .shape = {channels, rows, transport->cols}, .data = own->code};
  parts[SCALE] = (clt_hdf_array){
      .name = "/dense16/scale", .type = H5T_NATIVE_FLOAT, .rank = 2, .shape = {channels, rows}, .data = own->scale};
  parts[DIAGONAL] = (clt_hdf_array){.name = "/dense16/diagonal",
                                    .type = H5T_NATIVE_FLOAT,
                                    .rank = 2,
                                    .shape = {channels, clt_packed_diagonal_count(transport)},
                                    .data = own->packed.diagonal};
}

static clt_status load_parts(clt_transport *transport, const clt_hdf *hdf, hid_t half, clt_error *error) {
  dense16 *own = transport->storage;
  clt_hdf_array parts[PARTS];
  list_parts(transport, half, parts);
  parts[CODE].shape[1] = CLT_HDF_ANY;
  clt_status status = clt_hdf_read(hdf, &parts[CODE], error);
  own->code = parts[CODE].data;
  if (status == CLT_OK) {
    status = clt_transport_set_rows(transport, parts[CODE].shape[1], hdf->path, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  list_parts(transport, half, parts);
  status = clt_hdf_read(hdf, &parts[SCALE], error);
  own->scale = parts[SCALE].data;
  if (status == CLT_OK) {
    status = clt_hdf_read(hdf, &parts[DIAGONAL], error);
    own->packed.diagonal = parts[DIAGONAL].data;
  }
  return status;
}

static clt_status check_diagonal_codes(const clt_transport *transport, const char *path, clt_error *error) {
  for (int c = 0; c < transport->channels; c++) {
    for (size_t i = 0; i < clt_packed_diagonal_count(transport); i++) {
      if ((codes_of(transport, c, i)[i] & 0x7fff) != 0) {
        return clt_packed_refuse_diagonal(path, "/dense16/value", c, i, error);
      }
    }
  }
  return CLT_OK;
}

static clt_status dense16_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_status status = begin(transport, error);
  hid_t half = clt_hdf_half();
  if (status == CLT_OK) {
    status = load_parts(transport, hdf, half, error);
  }
  H5Tclose(half);
  return status == CLT_OK ? check_diagonal_codes(transport, hdf->path, error) : status;
}

static clt_status dense16_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hdf_array parts[PARTS];
  hid_t half = clt_hdf_half();
  list_parts(transport, half, parts);
  clt_status status = clt_hdf_make_group(hdf, "/dense16", error);
  for (int part = 0; part < PARTS && status == CLT_OK; part++) {
    status = clt_hdf_write(hdf, &parts[part], error);
  }
  H5Tclose(half);
  return status;
}

static void dense16_destroy(clt_transport *transport) {
  dense16 *own = transport->storage;
  if (own != NULL) {
    free(own->code);
    free(own->scale);
    free(own->packed.diagonal);
    free(own);
  }
}

const clt_kind clt_kind_dense16 = {.name = "dense16",
                                   .apply = clt_packed_apply,
                                   .apply_transposed = clt_packed_apply_transposed,
                                   .diagonal = clt_packed_diagonal,
                                   .row_sums = dense16_row_sums,
                                   .bytes = dense16_bytes,
                                   .entries = clt_packed_entries,
                                   .row = clt_packed_row,
                                   .most = FLT_MAX,
                                   .reserve = dense16_reserve,
                                   .put_row = dense16_put_row,
                                   .check = dense16_check,
                                   .load = dense16_load,
                                   .save = dense16_save,
                                   .destroy = dense16_destroy};
