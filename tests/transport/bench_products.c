/* What a product with dense storage takes, beside a plain read of the same bytes by the same threads in the same run.
 * Usage: bench_products [CELLS...]; the best of many. */
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "tradeoff/bench/bench.h"
#include "transport/kind.h"

static const double SECONDS_PER_STORAGE = 2;
enum { REPEATS = 5 };

/* A transport of some storage with 1 everywhere. */
static clt_transport *make_even(const clt_kind *kind, size_t cells, clt_error *error) {
  clt_transport *transport = NULL;
  double *row = calloc(cells, sizeof *row);
  if (row == NULL || clt_transport_begin(kind, (int)cells, 1, 1, "bench_products", &transport, error) != CLT_OK ||
      clt_transport_set_rows(transport, cells, "bench_products", error) != CLT_OK ||
      clt_transport_keep_black(transport, error) != CLT_OK || kind->reserve(transport, error) != CLT_OK) {
    free(row);
    clt_transport_destroy(transport);
    return NULL;
  }
  for (size_t j = 0; j < cells; j++) {
    row[j] = 1;
  }
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < cells; i++) {
    kind->put_row(transport, 0, i, row);
  }
  free(row);
  return transport;
}

static void tell(const clt_transport *transport, const char *what, double best_s, double read_s) {
  const double bytes = (double)transport->kind->bytes(transport);
  printf("%6zu  %-8s  %-10s %7.1f MB %9.3f ms %6.1f GB/s %5.0f %% of the read\n", transport->cols,
         transport->kind->name, what, 1e-6 * bytes, 1e3 * best_s, 1e-9 * bytes / best_s, 100 * read_s / best_s);
}

static double least(double best, int64_t start_ns) {
  const double now = clt_clock_since(start_ns);
  return now < best ? now : best;
}

static bool measure(const clt_kind *kind, size_t cells, clt_error *error) {
  clt_transport *transport = make_even(kind, cells, error);
  double *x = calloc(2 * cells, sizeof *x), *y = x + cells, read_s = 1e9, apply_s = 1e9, transposed_s = 1e9;
  bool right = transport != NULL && x != NULL;
  const int64_t start_ns = clt_clock_ns();
  for (int k = 0; right && (k < REPEATS || clt_clock_since(start_ns) < SECONDS_PER_STORAGE); k++) {
    for (size_t j = 0; j < cells; j++) {
      x[j] = 1;
    }
    int64_t now_ns = clt_clock_ns();
    right =
        clt_bench_read(transport->storage, kind->bytes(transport) / sizeof(uint64_t)) % 2 == 0; /* as all words are */
    read_s = least(read_s, now_ns);
    now_ns = clt_clock_ns();
    clt_transport_apply(transport, 0, x, y);
    apply_s = least(apply_s, now_ns);
    now_ns = clt_clock_ns();
    clt_transport_apply_transposed(transport, 0, y, x);
    transposed_s = least(transposed_s, now_ns);
    right = right && y[0] == (double)cells && x[cells - 1] == (double)cells * (double)cells;
  }
  if (right) {
    tell(transport, "read", read_s, read_s);
    tell(transport, "T x", apply_s, read_s);
    tell(transport, "T' y", transposed_s, read_s);
  }
  free(x);
  clt_transport_destroy(transport);
  return right;
}

int main(int count, char **arguments) {
  static const size_t usual[] = {1024, 5120};
  clt_error error = {.message = "a product is wrong"};
  bool done = true;
  for (int k = 1; k < (count > 1 ? count : 3) && done; k++) {
    const size_t cells = count > 1 ? (size_t)atol(arguments[k]) : usual[k - 1];
    done = measure(&clt_kind_dense, cells, &error) && measure(&clt_kind_dense64, cells, &error);
  }
  if (!done) {
    fprintf(stderr, "bench_products: %s\n", error.message);
  }
  return done ? 0 : 1;
}
