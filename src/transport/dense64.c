/* Dense storage in double precision. */
#define REAL double
#define DOT dot_double
#define ADD add_double
#include "transport/check.h"
#include "transport/dense_plain.h"

static float *dense64_entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL; /* they are no floats */
}

static clt_status dense64_check(const clt_transport *transport, const char *source, clt_error *error) {
  return clt_check_rows(transport, source, "/dense64", error);
}

static clt_status dense64_load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  return load_array(transport, hdf, dense_array(transport, "/dense64", H5T_NATIVE_DOUBLE), error);
}

static clt_status dense64_save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hdf_array array = dense_array(transport, "/dense64", H5T_NATIVE_DOUBLE);
  return clt_hdf_write(hdf, &array, error);
}

const clt_kind clt_kind_dense64 = {.name = "dense64",
                                   .apply = dense_apply,
                                   .apply_transposed = dense_apply_transposed,
                                   .diagonal = dense_diagonal,
                                   .row_sums = dense_row_sums,
                                   .bytes = dense_bytes,
                                   .entries = dense64_entries,
                                   .row = dense_row,
                                   .most = DBL_MAX,
                                   .reserve = dense_reserve,
                                   .put_row = dense_put_row,
                                   .check = dense64_check,
                                   .load = dense64_load,
                                   .save = dense64_save,
                                   .destroy = dense_destroy};
