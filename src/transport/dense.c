/* Dense storage in single precision. */
#define REAL float
#define DOT dot_float
#define ADD add_float
#include "transport/check.h"
#include "transport/dense_plain.h"

static float *dense_entries(const clt_transport *transport, int channel) {
  return (float *)transport->storage + (size_t)channel * transport->rows * transport->cols;
}

static clt_status dense_check(const clt_transport *transport, const char *source, clt_error *error) {
  clt_values values = {.source = source,
                       .name = "/dense",
                       .rank = 3,
                       .shape = {(size_t)transport->channels, transport->rows, transport->cols},
                       .data = transport->storage};
  return clt_check_entries(&values, error);
}

static clt_status dense_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  return load_array(transport, hdf, dense_array(transport, "/dense", H5T_NATIVE_FLOAT), error);
}

static clt_status dense_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hdf_array array = dense_array(transport, "/dense", H5T_NATIVE_FLOAT);
  return clt_hdf_write(hdf, &array, error);
}

const clt_kind clt_kind_dense = {.name = "dense",
                                 .apply = dense_apply,
                                 .apply_transposed = dense_apply_transposed,
                                 .diagonal = dense_diagonal,
                                 .row_sums = dense_row_sums,
                                 .bytes = dense_bytes,
                                 .entries = dense_entries,
                                 .row = dense_row,
                                 .most = FLT_MAX,
                                 .reserve = dense_reserve,
                                 .put_row = dense_put_row,
                                 .check = dense_check,
                                 .load = dense_load,
                                 .save = dense_save,
                                 .destroy = dense_destroy};

clt_status clt_transport_create_dense(int width, int height, int channels, size_t rows, clt_transport **out,
                                      clt_error *error) {
  clt_status status = clt_transport_begin(&clt_kind_dense, width, height, channels, "a dense transport", out, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_transport *transport = *out;
  status = clt_transport_set_rows(transport, rows, "a dense transport", error);
  if (status == CLT_OK) {
    status = dense_reserve(transport, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_keep_black(transport, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    *out = NULL;
  }
  return status;
}
