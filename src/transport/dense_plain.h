/* Dense storage of plain numbers, channels x rows x cols, row-major. Products accumulate in double. A storage kind
 * defines REAL, the type of an entry, DOT and ADD, its kernels, and includes this once. */
#include <omp.h>
#include <stdlib.h>

#include "base/memory.h"
#include "transport/kernels.h"
#include "transport/kind.h"

enum {
  LANES = 8,  /* partial sums of a row, so that additions do not wait for each other */
  PANEL = 64, /* rows that a transposed product takes up at once */
  TILE = 8192 /* columns of x that it keeps in the nearest caches meanwhile; rows are read in long runs */
};

static const REAL *row_of(const clt_transport *transport, int channel, size_t row) {
  return (const REAL *)transport->storage + ((size_t)channel * transport->rows + row) * transport->cols;
}

/* Adds in a fixed order, whatever the compiler. */
static double add_lanes(const double *sum) {
  return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

static double row_sum(const REAL *row, size_t cols) {
  double sum[LANES] = {0};
  size_t j = 0;
  for (; j + LANES <= cols; j += LANES) {
    for (int lane = 0; lane < LANES; lane++) {
      sum[lane] += (double)row[j + (size_t)lane];
    }
  }
  for (int lane = 0; j < cols; j++, lane++) {
    sum[lane] += (double)row[j];
  }
  return add_lanes(sum);
}

static void dense_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  const size_t cols = transport->cols, rows = transport->rows;
  const clt_plain_kernels *kernels = clt_plain_choose();
#pragma omp parallel for schedule(static) if (rows * cols >= CLT_WORTH_SHARING)
  for (size_t i = 0; i < rows; i += CLT_PLAIN_ROWS) {
    const REAL *row[CLT_PLAIN_ROWS];
    double sum[CLT_PLAIN_ROWS];
    for (size_t r = 0; r < CLT_PLAIN_ROWS; r++) { /* behind the last row, that row again */
      row[r] = row_of(transport, channel, i + r < rows ? i + r : rows - 1);
    }
    kernels->DOT(row, x, cols, sum);
    for (size_t r = 0; r < CLT_PLAIN_ROWS && i + r < rows; r++) {
      y[i + r] = sum[r];
    }
  }
}

static void dense_row_sums(const clt_transport *transport, int channel, double *sums) {
  const size_t cols = transport->cols, rows = transport->rows;
#pragma omp parallel for schedule(static) if (rows * cols >= CLT_WORTH_SHARING)
  for (size_t i = 0; i < rows; i++) {
    sums[i] = row_sum(row_of(transport, channel, i), cols);
  }
}

/* The next rows, at most PANEL, whose y is not zero; returns how many and moves *next behind them. */
static int gather_rows(const double *y, size_t rows, size_t *next, size_t picked[PANEL]) {
  int count = 0;
  size_t i = *next;
  for (; i < rows && count < PANEL; i++) {
    if (y[i] != 0) {
      picked[count++] = i;
    }
  }
  *next = i;
  return count;
}

/* x[j] += sum over the picked rows of y_i T_ij, for `cols` columns from `first`, four rows at a time. Every column adds
 * in the same order wherever a thread's share begins. */
static void add_rows(const clt_transport *transport, int channel, const double *y, const size_t *picked, int count,
                     size_t first, size_t cols, double *x) {
  const clt_plain_kernels *kernels = clt_plain_choose();
  int k = 0;
  for (; k + CLT_PLAIN_ROWS <= count; k += CLT_PLAIN_ROWS) {
    const REAL *row[CLT_PLAIN_ROWS];
    double factor[CLT_PLAIN_ROWS];
    for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
      row[r] = row_of(transport, channel, picked[k + r]) + first;
      factor[r] = y[picked[k + r]];
    }
    kernels->ADD(row, factor, cols, x);
  }
  for (; k < count; k++) {
    const REAL *a = row_of(transport, channel, picked[k]) + first;
    const double ya = y[picked[k]];
    for (size_t j = 0; j < cols; j++) {
      x[j] += ya * (double)a[j];
    }
  }
}

/* The columns first..first + cols - 1 of T'y: panels of rows stream by while a tile of x stays in the cache. */
static void transposed_tile(const clt_transport *transport, int channel, const double *y, size_t first, size_t cols,
                            double *x) {
  size_t picked[PANEL], next = 0;
  for (size_t j = 0; j < cols; j++) {
    x[first + j] = 0;
  }
  for (int count; (count = gather_rows(y, transport->rows, &next, picked)) > 0;) {
    for (size_t done = 0; done < cols; done += TILE) {
      size_t width = cols - done < TILE ? cols - done : TILE;
      add_rows(transport, channel, y, picked, count, first + done, width, x + first + done);
    }
  }
}

/* Each thread owns a range of columns, so that no partial sums need adding up. */
static void dense_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  const size_t cols = transport->cols;
  const size_t share = 512;
  const size_t shares = (cols + share - 1) / share;
#pragma omp parallel if (transport->rows * cols >= CLT_WORTH_SHARING)
  {
    const size_t threads = (size_t)omp_get_num_threads(), me = (size_t)omp_get_thread_num();
    const size_t begin = shares * me / threads * share;
    size_t end = shares * (me + 1) / threads * share;
    end = end < cols ? end : cols;
    if (begin < end) {
      transposed_tile(transport, channel, y, begin, end - begin, x);
    }
  }
}

static void dense_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  for (size_t i = 0; i < transport->rows && i < transport->cols; i++) {
    diagonal[i] = row_of(transport, channel, i)[i];
  }
}

static size_t dense_bytes(const clt_transport *transport) {
  return (size_t)transport->channels * transport->rows * transport->cols * sizeof(REAL);
}

static void dense_row(const clt_transport *transport, int channel, size_t row, double *values) {
  const REAL *entries = row_of(transport, channel, row);
  for (size_t j = 0; j < transport->cols; j++) {
    values[j] = (double)entries[j];
  }
}

static void dense_put_row(clt_transport *transport, int channel, size_t row, const double *values) {
  REAL *entries = (REAL *)transport->storage + ((size_t)channel * transport->rows + row) * transport->cols;
  for (size_t j = 0; j < transport->cols; j++) {
    entries[j] = (REAL)values[j];
  }
}

static clt_status dense_reserve(clt_transport *transport, clt_error *error) {
  /* rows and cols are at most 2^28 each, so that neither factor overflows; clt_alloc looks after the product */
  transport->storage = clt_alloc(transport->rows * transport->cols, (size_t)transport->channels * sizeof(REAL));
  return transport->storage != NULL ? CLT_OK : clt_transport_too_large(transport, dense_bytes(transport), error);
}

static clt_hdf_array dense_array(const clt_transport *transport, const char *name, hid_t type) {
  return (clt_hdf_array){.name = name,
                         .type = type,
                         .rank = 3,
                         .shape = {(size_t)transport->channels, transport->rows, transport->cols},
                         .data = transport->storage};
}

static clt_status load_array(clt_transport *transport, const clt_hdf *hdf, clt_hdf_array array, clt_error *error) {
  array.shape[1] = CLT_HDF_ANY;
  clt_status status = clt_hdf_read(hdf, &array, error);
  if (status != CLT_OK) {
    return status;
  }
  transport->storage = array.data;
  return clt_transport_set_rows(transport, array.shape[1], hdf->path, error);
}

static void dense_destroy(clt_transport *transport) {
  free(transport->storage);
}
