/* The bench on a small room: what it says of bytes, errors and order can be checked; times only for being there. */
#include "counterlight/bench.h"
#include "support.h"

enum { WIDTH = 64, HEIGHT = 32, BLOCKS = 6, CELLS = WIDTH * HEIGHT };

/* T is near light and M = f g' + g f': rows of one block differ by f alone, as entries of a product show. */
static void test_room(void **unused) {
  (void)unused;
  clt_transport *room = NULL, *same = NULL;
  clt_error error = {0};
  assert_ok(clt_bench_room(WIDTH, HEIGHT, BLOCKS, 3, &room, &error), error);
  assert_ok(clt_bench_room(WIDTH, HEIGHT, BLOCKS, 3, &same, &error), error);
  double *a = calloc(3 * CELLS, sizeof *a), *b = a + CELLS, *diagonal = a + 2 * CELLS;
  for (int c = 0; c < 3; c++) {
    double far = 0, near = 0;
    clt_transport_row_sums(room, c, a);
    clt_transport_row_sums(same, c, b);
    clt_transport_diagonal(room, c, diagonal);
    for (size_t i = 0; i < CELLS; i++) {
      assert_true(a[i] == b[i]);
      far += a[i] - diagonal[i];
      near += diagonal[i];
    }
    assert_true(far > 0.1 * near && far < near);
  }
  free(a);
  clt_transport_destroy(room);
  clt_transport_destroy(same);
  assert_int_equal(clt_bench_room(WIDTH, HEIGHT, 0, 1, &room, &error), CLT_BAD_INPUT);
  assert_null(room);
}

static void test_report(void **unused) {
  (void)unused;
  clt_transport *room = NULL;
  clt_bench_report report;
  clt_error error = {0};
  const clt_bench_options options = {.frames = 20, .target_error = 0.002};
  assert_ok(clt_bench_room(WIDTH, HEIGHT, BLOCKS, 3, &room, &error), error);
  assert_ok(clt_bench(room, &options, &report, &error), error);
  assert_true(report.bandwidth_gbs > 0);
  assert_int_equal(report.kernel_count, 4 + 5);
  assert_string_equal(report.kernel[8].name, "frame: look");
  assert_true(report.kernel[8].bytes > 3 * CELLS * 8 * sizeof(float));
  assert_true(report.kernel[0].bytes == (double)clt_transport_describe(room).bytes + 2 * 3 * CELLS * sizeof(double));
  for (int k = 0; k < report.kernel_count; k++) {
    const clt_bench_kernel *kernel = &report.kernel[k];
    assert_near(kernel->fraction, 1e-6 * kernel->bytes / kernel->ms / report.bandwidth_gbs, 1e-9 * kernel->fraction);
  }
  assert_int_equal(report.frame.cells, CELLS);
  assert_true(report.frame.p50_ms > 0 && report.frame.p50_ms <= report.frame.p99_ms);
  assert_true(report.frame.residual <= options.target_error && report.frame.error >= report.frame.residual);
  assert_true(report.frame.clipped == 0 && report.held.clipped > 0.1 && report.held.residual > report.frame.residual);
  assert_true(report.held.p50_ms > 0 && report.held.p50_ms <= report.held.p99_ms && report.held.steps > 1);
  assert_int_equal(report.peer_count, 3);
  assert_string_equal(report.peer[0].name, "report-jacobi-csr-f32");
  assert_true(report.peer[0].error <= options.target_error && report.peer[0].entries >= 128);
  assert_true(report.peer[1].error <= options.target_error && report.peer[2].error <= 2 * options.target_error);
  for (int k = 0; k < report.peer_count; k++) {
    const clt_bench_peer *peer = &report.peer[k];
    assert_true(peer->converged && peer->ms > 0 && peer->warm_ms > 0);
    assert_near(peer->ratio, peer->ms / report.frame.cold_ms, 1e-9 * peer->ratio);
    assert_near(peer->warm_ratio, peer->warm_ms / report.frame.p50_ms, 1e-9 * peer->warm_ratio);
  }
  assert_int_equal(report.point_count, 0);
  clt_transport_destroy(room);
}

/* Far light of 1.5 times a cell's own: what diverges is told and not waited for. */
static void test_divergence(void **unused) {
  (void)unused;
  enum { SIDE = 16, N = SIDE * SIDE };
  clt_transport *room = NULL;
  clt_bench_report report;
  clt_error error = {0};
  const clt_bench_options options = {.frames = 10, .target_error = 0.01};
  assert_ok(clt_transport_create_dense(SIDE, SIDE, 1, N, &room, &error), error);
  float *entries = clt_transport_entries(room, 0);
  for (size_t at = 0; at < N * N; at++) {
    entries[at] = 1.5f / N + (at % (N + 1) == 0 ? 1.0f : 0.0f);
  }
  assert_ok(clt_bench(room, &options, &report, &error), error);
  assert_string_equal(report.peer[0].name, "report-jacobi-csr-f32");
  assert_true(!report.peer[0].converged && report.peer[0].ratio == 0);
  assert_true(report.peer[1].converged && report.peer[1].error <= options.target_error);
  clt_transport_destroy(room);
}

static void test_refusals(void **unused) {
  (void)unused;
  clt_transport *room = NULL;
  clt_bench_report report;
  clt_error error = {0};
  const clt_bench_options bad = {.frames = 3};
  assert_ok(clt_bench_room(WIDTH, HEIGHT, BLOCKS, 3, &room, &error), error);
  assert_int_equal(clt_bench(room, &bad, &report, &error), CLT_BAD_INPUT);
  clt_transport_destroy(room);
  assert_ok(clt_transport_create_dense(4, 4, 1, 16, &room, &error), error); /* dark */
  assert_int_equal(clt_bench(room, NULL, &report, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "no cell of the transport is lit"));
  clt_transport_destroy(room);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_room), cmocka_unit_test(test_report),
                                     cmocka_unit_test(test_divergence), cmocka_unit_test(test_refusals)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
