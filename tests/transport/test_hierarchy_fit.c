/* A hierarchy by the rows of any T, against entries known in closed form: two walls at a right angle. */
#include <omp.h>

#include "cases.h"
#include "transport/hierarchy.h"

enum { WIDTH = 44, HEIGHT = 30, CELLS = WIDTH * HEIGHT };

/* Light between the walls x = 0 and y = 0 of unit width, the left half of the grid and the right one: cos cos' / (pi
 * r^2) times area, from middle to middle. No light stays on a wall. */
static double exchange(int i, int j) {
  const double a = (i % WIDTH + 0.5 - WIDTH / 2.0) * 2 / WIDTH, b = (j % WIDTH + 0.5 - WIDTH / 2.0) * 2 / WIDTH;
  const double up = (i / WIDTH - j / WIDTH) / (double)HEIGHT;
  const double squared = a * a + b * b + up * up;
  return a * b < 0 ? -a * b / (3.14159265358979 * squared * squared) * 2 / CELLS : 0;
}

/* Entries of channels x N x N: direct light about 1, and far light of cells that reflect and are lit unalike. */
static double *make_entries(int channels, uint64_t *state) {
  double *entries = calloc((size_t)channels * CELLS * CELLS, sizeof *entries);
  double *albedo = random_vector(2 * CELLS, state), *given = albedo + CELLS;
  for (int c = 0; c < channels; c++) {
    for (int i = 0; i < CELLS; i++) {
      albedo[i] = 0.3 + 0.6 * test_random(state);
      given[i] = 0.5 + test_random(state);
    }
    for (int i = 0; i < CELLS; i++) {
      for (int j = 0; j < CELLS; j++) {
        entries[((size_t)c * CELLS + (size_t)i) * CELLS + (size_t)j] =
            albedo[i] * ((i == j ? given[i] : 0) + exchange(i, j) * albedo[j] * given[j]);
      }
    }
  }
  free(albedo);
  return entries;
}

/* They as dense storage, each entry off by noise of that deviation, which the transport tells. */
static clt_transport *dense_of(const double *entries, int channels, double noise, uint64_t *state) {
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_dense(WIDTH, HEIGHT, channels, CELLS, &made, &error), error);
  assert_ok(noise > 0 ? clt_transport_keep_sigma(made, &error) : CLT_OK, error);
  for (int c = 0; c < channels; c++) {
    float *to = clt_transport_entries(made, c);
    for (size_t k = 0; k < (size_t)CELLS * CELLS; k++) {
      const double sum = test_random(state) + test_random(state) + test_random(state) + test_random(state);
      to[k] = (float)(entries[(size_t)c * CELLS * CELLS + k] + noise * sqrt(3) * (sum - 2));
    }
    for (size_t i = 0; i < CELLS && noise > 0; i++) {
      clt_transport_sigma_values(made, c)[i] = (float)noise;
    }
  }
  return made;
}

static clt_transport *hierarchy_of_rows(const clt_transport *from, double tolerance) {
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_hierarchy(from, tolerance, &made, &error), error);
  return made;
}

/* ||T' x - entries x|| / ||entries x||, or of the transposed product. */
static double off_by(const clt_transport *transport, int channel, const double *entries, const double *x,
                     bool transposed) {
  double *y = calloc(CELLS, sizeof *y), apart = 0, whole = 0;
  const double *of = entries + (size_t)channel * CELLS * CELLS;
  (transposed ? clt_transport_apply_transposed : clt_transport_apply)(transport, channel, x, y);
  for (size_t i = 0; i < CELLS; i++) {
    double wanted = 0;
    for (size_t j = 0; j < CELLS; j++) {
      wanted += (transposed ? of[j * CELLS + i] : of[i * CELLS + j]) * x[j];
    }
    apart += (y[i] - wanted) * (y[i] - wanted);
    whole += wanted * wanted;
  }
  free(y);
  return sqrt(apart / whole);
}

static void draw(int kind, double *x, uint64_t *state) {
  for (int j = 0; j < CELLS; j++) {
    const int across = j % WIDTH, down = j / WIDTH;
    x[j] = kind == 0 ? test_random(state) : kind == 1 ? (across / 7 + down / 7) % 2 : across < WIDTH / 2;
  }
}

/* Within the tolerance for pictures without order, twice that for bands and a lit wall, and again for T', whose sums
 * are not kept; the sums of rows and the
 * diagonal are those of T. Bytes fall to less than a tenth. */
static void test_products(void **unused) {
  (void)unused;
  uint64_t state = 3;
  double x[CELLS];
  for (int channels = 1; channels <= 3; channels += 2) {
    double *entries = make_entries(channels, &state);
    clt_transport *dense = dense_of(entries, channels, 0, &state);
    const double tolerances[] = {5e-3, 1e-3};
    for (int t = 0; t < 2; t++) {
      clt_transport *made = hierarchy_of_rows(dense, tolerances[t]);
      assert_true(10 * clt_transport_describe(made).bytes < clt_transport_describe(dense).bytes);
      for (int c = 0; c < channels; c++) {
        for (int kind = 0; kind < 3; kind++) {
          draw(kind, x, &state);
          const double allowed = (kind == 0 ? 1 : 2) * tolerances[t];
          const double forward = off_by(made, c, entries, x, false), back = off_by(made, c, entries, x, true);
          print_message("%d channels to %g, picture %d: %.2g, transposed %.2g\n", channels, tolerances[t], kind,
                        forward, back);
          assert_true(forward < allowed && back < 8 * tolerances[t]);
          assert_true(kind != 1 || forward < 2 * clt_transport_simplified(made));
        }
        double sums[CELLS], own[CELLS];
        clt_transport_row_sums(made, c, sums);
        clt_transport_diagonal(made, c, own);
        for (int i = 0; i < CELLS; i++) {
          const double *row = entries + ((size_t)c * CELLS + (size_t)i) * CELLS;
          double sum = 0;
          for (int j = 0; j < CELLS; j++) {
            sum += row[j];
          }
          assert_near(sums[i], sum, 1e-5 * sum);
          assert_near(own[i], row[i], 1e-3 * row[i]);
        }
      }
      print_message("%ld near entries, %zu bytes of %zu\n", (long)clt_hierarchic_of(made)->start[CELLS],
                    clt_transport_describe(made).bytes, clt_transport_describe(dense).bytes);
      clt_transport_destroy(made);
    }
    clt_transport_destroy(dense);
    free(entries);
  }
}

/* A bright spot beyond the other wall's edge, which no bilinear function has: it stands by itself. */
static void test_highlights(void **unused) {
  (void)unused;
  uint64_t state = 11;
  double x[CELLS];
  double *entries = make_entries(1, &state);
  for (int k = 0; k < 2 * CELLS; k++) {
    entries[(size_t)(test_random(&state) * CELLS * CELLS)] += 0.05 * test_random(&state);
  }
  clt_transport *dense = dense_of(entries, 1, 0, &state), *made = hierarchy_of_rows(dense, 2e-3);
  draw(0, x, &state);
  assert_true(off_by(made, 0, entries, x, false) < 2e-3);
  print_message("%ld near entries of %d spots\n", (long)clt_hierarchic_of(made)->start[CELLS], 2 * CELLS);
  assert_true(clt_hierarchic_of(made)->start[CELLS] < 12 * CELLS);
  clt_transport_destroy(made);
  clt_transport_destroy(dense);
  free(entries);
}

/* Noise that T tells of itself is no light: few entries stand by themselves, and the products come nearer to what T is
 * without noise. The sums of rows keep theirs: in a drive of mean 0 they do not count. */
static void test_noise(void **unused) {
  (void)unused;
  double x[CELLS];
  for (uint64_t seed = 1; seed <= 2; seed++) {
    uint64_t state = seed;
    double *entries = make_entries(1, &state), mean = 0;
    clt_transport *dense = dense_of(entries, 1, 3e-4, &state), *made = hierarchy_of_rows(dense, 2e-3);
    draw(0, x, &state);
    for (int j = 0; j < CELLS; j++) {
      mean += x[j] / CELLS;
    }
    for (int j = 0; j < CELLS; j++) {
      x[j] -= mean;
    }
    const double before = off_by(dense, 0, entries, x, false), after = off_by(made, 0, entries, x, false);
    print_message("noise %.2g, smoothed %.2g, %ld near entries of %d\n", before, after,
                  (long)clt_hierarchic_of(made)->start[CELLS], CELLS * CELLS);
    assert_true(after < 0.75 * before);
    assert_true(clt_hierarchic_of(made)->start[CELLS] < CELLS * CELLS / 100);
    clt_transport_destroy(made);
    clt_transport_destroy(dense);
    free(entries);
  }
}

/* Other storage of the same T gives the same hierarchy but for what it rounds; so does any number of threads. */
static void test_storages_and_threads(void **unused) {
  (void)unused;
  uint64_t state = 21;
  double x[CELLS], one[CELLS], other[CELLS];
  double *entries = make_entries(1, &state);
  clt_error error = {0};
  clt_transport *dense = dense_of(entries, 1, 0, &state), *half = NULL;
  assert_ok(clt_transport_convert(dense, "dense16", &half, &error), error);
  draw(0, x, &state);
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  clt_transport *made = hierarchy_of_rows(dense, 1e-3);
  omp_set_num_threads(3);
  clt_transport *again = hierarchy_of_rows(dense, 1e-3), *rounded = hierarchy_of_rows(half, 1e-3);
  omp_set_num_threads(before);
  clt_transport_apply(made, 0, x, one);
  clt_transport_apply(again, 0, x, other);
  assert_int_equal(clt_hierarchic_of(made)->start[CELLS], clt_hierarchic_of(again)->start[CELLS]);
  for (int i = 0; i < CELLS; i++) {
    assert_near(other[i], one[i], 1e-6 * one[i]);
  }
  assert_true(off_by(rounded, 0, entries, x, false) < 2e-3);
  clt_transport_destroy(rounded);
  clt_transport_destroy(again);
  clt_transport_destroy(made);
  clt_transport_destroy(half);
  clt_transport_destroy(dense);
  free(entries);
}

/* Light without order, and rows that are not the cells. */
static void test_refusals(void **unused) {
  (void)unused;
  uint64_t state = 31;
  clt_error error = {0};
  clt_transport *made = NULL;
  const size_case square = {24, 16, 1, 384}, tall = {9, 8, 1, 80};
  known_transport disordered = random_dense(&square, &state), other = random_dense(&tall, &state);
  assert_int_equal(clt_transport_create_hierarchy(disordered.transport, 1e-3, &made, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "does not vary evenly"));
  assert_int_equal(clt_transport_create_hierarchy(other.transport, 1e-3, &made, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "80"));
  assert_null(made);
  finish_known(&disordered);
  finish_known(&other);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_products), cmocka_unit_test(test_highlights),
                                     cmocka_unit_test(test_noise), cmocka_unit_test(test_storages_and_threads),
                                     cmocka_unit_test(test_refusals)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
