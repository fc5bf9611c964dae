#include "transport/packed.h"

#include <math.h>
#include <omp.h>
#include <string.h>

enum {
  PANEL = 128, /* rows for which a tile of x is made a float once */
  TILE = 4096, /* columns of such a tile */
  PICKED = 64, /* rows that a transposed product adds up in float */
  SHARE = 512  /* columns by which its threads part */
};

size_t clt_packed_diagonal_count(const clt_transport *transport) {
  return transport->rows < transport->cols ? transport->rows : transport->cols;
}

double clt_packed_diagonal_entry(const clt_transport *transport, int channel, size_t i) {
  const clt_packed *own = transport->storage;
  return (double)own->diagonal[(size_t)channel * clt_packed_diagonal_count(transport) + i];
}

static double offset_of(const clt_transport *transport, int channel, size_t row) {
  const clt_packed *own = transport->storage;
  return own->offset != NULL ? (double)own->offset[(size_t)channel * transport->rows + row] : 0;
}

/* A power of two, not below the largest magnitude; 1 for zeros and for what is not finite, which then shows. */
static double unit_of(const double *values, size_t count) {
  double largest = 0;
  for (size_t k = 0; k < count; k++) {
    largest = fabs(values[k]) > largest ? fabs(values[k]) : largest;
  }
  int exponent = 0;
  if (!(largest > 0 && isfinite(largest))) {
    return 1;
  }
  frexp(largest, &exponent);
  return ldexp(1, exponent < -1000 ? -1000 : exponent > 1023 ? 1023 : exponent);
}

static double to_floats(const double *values, size_t count, float *out) {
  const double unit = unit_of(values, count), inverse = 1 / unit;
  for (size_t k = 0; k < count; k++) {
    out[k] = (float)(values[k] * inverse);
  }
  return unit;
}

static void panel_product(const clt_transport *transport, int channel, size_t begin, size_t end, const double *x,
                          double *y) {
  const clt_packed *own = transport->storage;
  float tile[TILE];
  for (size_t first = 0; first < transport->cols; first += TILE) {
    const size_t width = transport->cols - first < TILE ? transport->cols - first : TILE;
    const double unit = to_floats(x + first, width, tile);
    for (size_t i = begin; i < end; i++) {
      double sum = 0;
      for (size_t done = 0; done < width; done += CLT_PACKED_SPAN) {
        const size_t count = width - done < CLT_PACKED_SPAN ? width - done : CLT_PACKED_SPAN;
        sum += own->form->dot(transport, channel, i, first + done, count, tile + done);
      }
      y[i] += unit * sum;
    }
  }
}

/* y_i = sum_j code_ij x_j + offset_i (sum_j x_j - x_i) + diagonal_i x_i */
void clt_packed_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  const size_t rows = transport->rows, cols = transport->cols, own_cells = clt_packed_diagonal_count(transport);
  double total = 0;
  for (size_t j = 0; j < cols; j++) {
    total += x[j];
  }
#pragma omp parallel for schedule(static) if (rows * cols >= CLT_WORTH_SHARING)
  for (size_t panel = 0; panel < (rows + PANEL - 1) / PANEL; panel++) {
    const size_t begin = panel * PANEL, end = begin + PANEL < rows ? begin + PANEL : rows;
    for (size_t i = begin; i < end; i++) {
      const double offset = offset_of(transport, channel, i);
      y[i] = i < own_cells ? offset * (total - x[i]) + clt_packed_diagonal_entry(transport, channel, i) * x[i]
                           : offset * total;
    }
    panel_product(transport, channel, begin, end, x, y);
  }
}

/* The next rows, at most PICKED, whose y is not zero, with y times the row's factor; moves *next behind them. */
static int gather_rows(const clt_transport *transport, int channel, const double *y, size_t *next, size_t *picked,
                       double *weight) {
  const clt_packed_form *form = ((const clt_packed *)transport->storage)->form;
  int count = 0;
  size_t i = *next;
  for (; i < transport->rows && count < PICKED; i++) {
    if (y[i] != 0) {
      picked[count] = i;
      weight[count++] = form->row_factor != NULL ? y[i] * form->row_factor(transport, channel, i) : y[i];
    }
  }
  *next = i;
  return count;
}

/* x_k += what the picked rows give, added up in float over a span of columns. The last group is filled up with its own
 * first row and no weight. */
static void add_rows(const clt_transport *transport, int channel, const size_t *picked, const double *weight, int count,
                     size_t first, size_t width, double *x) {
  const clt_packed *own = transport->storage;
  float sum[CLT_PACKED_SPAN] = {0}, y[PICKED];
  const double unit = to_floats(weight, (size_t)count, y);
  for (int k = 0; k < count; k += CLT_PACKED_GROUP) {
    size_t row[CLT_PACKED_GROUP];
    float factor[CLT_PACKED_GROUP];
    for (int member = 0; member < CLT_PACKED_GROUP; member++) {
      row[member] = picked[k + member < count ? k + member : k];
      factor[member] = k + member < count ? y[k + member] : 0;
    }
    own->form->add(transport, channel, row, factor, first, width, sum);
  }
  for (size_t k = 0; k < width; k++) {
    x[k] += unit * (double)sum[k];
  }
}

static void transposed_share(const clt_transport *transport, int channel, const double *y, size_t begin, size_t end,
                             double *x) {
  size_t picked[PICKED], next = 0;
  double weight[PICKED];
  for (int count; (count = gather_rows(transport, channel, y, &next, picked, weight)) > 0;) {
    for (size_t first = begin; first < end; first += CLT_PACKED_SPAN) {
      const size_t width = end - first < CLT_PACKED_SPAN ? end - first : CLT_PACKED_SPAN;
      add_rows(transport, channel, picked, weight, count, first, width, x + first);
    }
  }
}

/* x_j = sum_i code_ij y_i + (sum_i offset_i y_i - offset_j y_j) + diagonal_j y_j; each thread owns a range of columns,
 * so that no partial sums need adding up. */
void clt_packed_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  const size_t cols = transport->cols, own_cells = clt_packed_diagonal_count(transport);
  const size_t shares = (cols + SHARE - 1) / SHARE;
  double total = 0;
  for (size_t i = 0; i < transport->rows; i++) {
    total += offset_of(transport, channel, i) * y[i];
  }
#pragma omp parallel if (transport->rows * cols >= CLT_WORTH_SHARING)
  {
    const size_t threads = (size_t)omp_get_num_threads(), me = (size_t)omp_get_thread_num();
    const size_t begin = shares * me / threads * SHARE;
    size_t end = shares * (me + 1) / threads * SHARE;
    end = end < cols ? end : cols;
    for (size_t j = begin; j < end; j++) {
      double own =
          j < own_cells ? clt_packed_diagonal_entry(transport, channel, j) - offset_of(transport, channel, j) : 0;
      x[j] = total + (j < own_cells ? own * y[j] : 0);
    }
    transposed_share(transport, channel, y, begin, end, x);
  }
}

void clt_packed_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  for (size_t i = 0; i < clt_packed_diagonal_count(transport); i++) {
    diagonal[i] = clt_packed_diagonal_entry(transport, channel, i);
  }
}

void clt_packed_row(const clt_transport *transport, int channel, size_t row, double *values) {
  const clt_packed *own = transport->storage;
  const double offset = offset_of(transport, channel, row);
  own->form->decode(transport, channel, row, values);
  for (size_t j = 0; j < transport->cols; j++) {
    values[j] += offset;
  }
  if (row < clt_packed_diagonal_count(transport)) {
    values[row] = clt_packed_diagonal_entry(transport, channel, row);
  }
}

float *clt_packed_entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL;
}

void clt_packed_put_diagonal(clt_transport *transport, int channel, size_t row, const double *values) {
  clt_packed *own = transport->storage;
  const size_t count = clt_packed_diagonal_count(transport);
  if (row < count) {
    own->diagonal[(size_t)channel * count + row] = (float)values[row];
  }
}

clt_status clt_packed_refuse_diagonal(const char *path, const char *name, int channel, size_t i, clt_error *error) {
  return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%d, %zu, %zu] is not 0; entries on the diagonal are written apart",
                  path, name, channel, i, i);
}
