/* Products of a transport against its entries, summed here in double. */
#ifndef CLT_TESTS_TRANSPORT_PRODUCTS_H
#define CLT_TESTS_TRANSPORT_PRODUCTS_H

#include "cases.h"

/* What storage in single precision may be off by: of the terms of a sum, and of a row's largest entry. */
typedef struct allowance {
  double sum, diagonal;
} allowance;

static inline void assert_product(const double *ours, const double *entries, int cells, bool transposed,
                                  const double *in, double allowed) {
  for (int i = 0; i < cells; i++) {
    double wanted = 0, size = 0;
    for (int j = 0; j < cells; j++) {
      const double term = in[j] * (transposed ? entries[j * cells + i] : entries[i * cells + j]);
      wanted += term;
      size += fabs(term);
    }
    assert_near(ours[i], wanted, 1e-12 + allowed * size);
  }
}

static inline void assert_diagonal(const double *ours, const double *entries, int cells, double allowed) {
  for (int i = 0; i < cells; i++) {
    double size = 0;
    for (int j = 0; j < cells; j++) {
      size = fmax(size, fabs(entries[i * cells + j]));
    }
    assert_near(ours[i], entries[i * cells + i], allowed * size);
  }
}

static inline void check_products(const clt_transport *transport, int channel, const double *entries, allowance off_by,
                                  uint64_t *state) {
  const int cells = (int)clt_transport_describe(transport).cols;
  double *x = random_vector((size_t)cells, state), *ours = random_vector((size_t)cells, state);
  clt_transport_apply(transport, channel, x, ours);
  assert_product(ours, entries, cells, false, x, off_by.sum);
  clt_transport_apply_transposed(transport, channel, x, ours);
  assert_product(ours, entries, cells, true, x, off_by.sum);
  clt_transport_diagonal(transport, channel, ours);
  assert_diagonal(ours, entries, cells, off_by.diagonal);
  for (int j = 0; j < cells; j++) {
    x[j] = 1;
  }
  clt_transport_row_sums(transport, channel, ours);
  assert_product(ours, entries, cells, false, x, off_by.sum);
  free(x);
  free(ours);
}

#endif
