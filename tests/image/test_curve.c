#include "counterlight/image.h"
#include "support.h"

/* IEC 61966-2-1, with its rounded constants. */
static double iec_decode(double v) {
  return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double iec_encode(double l) {
  return l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055;
}

static void srgb_is_the_standards_curve(void **state) {
  (void)state;
  const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  for (int i = 0; i <= 100000; i++) {
    double v = i / 100000.0;
    assert_near(clt_curve_decode(&srgb, v), iec_decode(v), 3e-9);
    assert_near(clt_curve_encode(&srgb, v), iec_encode(v), 4e-8);
  }
  assert_near(clt_curve_decode(&srgb, 0.5), 0.21404114048223255, 1e-15); /* numbers of colour-science tables */
  assert_near(clt_curve_decode(&srgb, 188 / 255.0), 0.5028864580325687, 1e-15);
  assert_near(clt_curve_encode(&srgb, 0.18), 0.46135612950044164, 1e-15);
}

static const char *const texts[] = {"linear", "srgb", "gamma 2.2", "gamma:0.2", "gamma 5", "gamma 1.8"};

static void curves_are_monotone_and_keep_black_and_white(void **state) {
  (void)state;
  for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
    clt_curve curve;
    clt_error error = {0};
    assert_ok(clt_curve_parse(texts[k], &curve, &error), error);
    double light = -1, code = -1;
    for (int i = 0; i <= 200000; i++) {
      double next = clt_curve_decode(&curve, i / 200000.0), back = clt_curve_encode(&curve, i / 200000.0);
      assert_true(next > light || (next == light && next == 0));
      assert_true(back > code);
      light = next, code = back;
    }
    for (int i = 0; i < 40000; i++) { /* around the joint of sRGB's pieces, in steps that show a drop of 1e-9 */
      double at = 0.00313 + i * 1e-10;
      assert_true(clt_curve_encode(&curve, at + 1e-10) > clt_curve_encode(&curve, at));
      assert_true(clt_curve_decode(&curve, 12.92 * at + 1e-9) > clt_curve_decode(&curve, 12.92 * at));
    }
    assert_true(clt_curve_decode(&curve, 0) == 0 && clt_curve_encode(&curve, 0) == 0);
    assert_true(clt_curve_decode(&curve, 1) == 1 && clt_curve_encode(&curve, 1) == 1);
    assert_true(clt_curve_decode(&curve, -0.5) == 0 && clt_curve_encode(&curve, 1.5) == 1);
    assert_true(clt_curve_decode(&curve, INFINITY) == 1 && clt_curve_encode(&curve, NAN) == 0);
  }
}

static void encoding_undoes_decoding(void **state) {
  (void)state;
  for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++) {
    clt_curve curve;
    clt_error error = {0};
    assert_ok(clt_curve_parse(texts[k], &curve, &error), error);
    for (int code = 0; code <= 65535; code++) {
      double light = (float)clt_curve_decode(&curve, code / 65535.0);
      assert_near(clt_curve_encode(&curve, light) * 65535, code, 0.05);
    }
  }
}

static void gamma_is_a_power(void **state) {
  (void)state;
  const clt_curve curve = {.kind = CLT_CURVE_GAMMA, .gamma = 2};
  assert_near(clt_curve_decode(&curve, 0.3), 0.09, 1e-15);
  assert_near(clt_curve_encode(&curve, 0.09), 0.3, 1e-15);
}

static void texts_of_curves_are_read_back(void **state) {
  (void)state;
  uint64_t seed = 5;
  for (int i = 0; i < 1000; i++) {
    clt_curve curve = {.kind = CLT_CURVE_GAMMA, .gamma = 0.2 + 4.8 * test_random(&seed)}, again;
    clt_error error = {0};
    char text[24];
    clt_curve_format(&curve, text, sizeof text);
    assert_ok(clt_curve_parse(text, &again, &error), error);
    assert_near(again.gamma, curve.gamma, 1e-14);
  }
  clt_curve curve = {.kind = CLT_CURVE_GAMMA, .gamma = 2.2};
  char text[24];
  clt_curve_format(&curve, text, sizeof text);
  assert_string_equal(text, "gamma 2.2");
  for (size_t k = 0; k < 2; k++) {
    assert_int_equal(clt_curve_parse(texts[k], &curve, NULL), CLT_OK);
    clt_curve_format(&curve, text, sizeof text);
    assert_string_equal(text, texts[k]);
  }
}

static void other_texts_are_refused_with_what_is_allowed(void **state) {
  (void)state;
  static const char *const wrong[] = {"",         "gamma",      "gamma ",    "gamma 0.19", "gamma 5.1", "gamma nan",
                                      "gamma:-1", "gamma 2.2x", "gamma=2.2", "sRGB ",      "linear 1",  "gamma inf"};
  for (size_t k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
    clt_curve curve;
    clt_error error = {0};
    assert_int_equal(clt_curve_parse(wrong[k], &curve, &error), CLT_BAD_INPUT);
    assert_true(strstr(error.message, "0.2 to 5") != NULL || strstr(error.message, "gamma 2.2") != NULL);
  }
}

/* A table of any monotone curve: through its points, monotone between them, undone by encoding; and within the error
 * of cubics of the curve it was made from. */
static void tables_follow_what_they_were_made_from(void **state) {
  (void)state;
  static const struct {
    const char *text;
    int points;
    double tolerance;
  } cases[] = {{"linear", 2, 1e-15}, {"gamma 2.2", 65, 2e-5}, {"srgb", 33, 1.2e-4}, {"gamma 1.8", 64, 5e-5}};
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    clt_curve curve, table;
    clt_error error = {0};
    double codes[65], light[65];
    assert_ok(clt_curve_parse(cases[n].text, &curve, &error), error);
    for (int i = 0; i < cases[n].points; i++) { /* codes of a panel of 8 bits, not equidistant */
      codes[i] = rint(255.0 * i / (cases[n].points - 1)) / 255;
      light[i] = clt_curve_decode(&curve, codes[i]);
    }
    assert_ok(clt_curve_from_points(codes, light, cases[n].points, &table, &error), error);
    assert_int_equal(table.kind, CLT_CURVE_TABLE);
    double before = -1;
    for (int i = 0; i <= 20000; i++) {
      double at = i / 20000.0, value = clt_curve_decode(&table, at);
      assert_near(value, clt_curve_decode(&curve, at), cases[n].tolerance);
      assert_true(value > before || i == 0);
      assert_near(clt_curve_decode(&table, clt_curve_encode(&table, at)), at, 1e-13);
      before = value;
    }
  }
}

/* Random rising tables, with flat stretches: monotone, and encoding gives a code of that light. */
static void tables_keep_their_order(void **state) {
  (void)state;
  uint64_t random = 9;
  for (int round = 0; round < 50; round++) {
    clt_curve table = {.kind = CLT_CURVE_TABLE};
    double sum = 0;
    for (int i = 1; i < CLT_CURVE_SAMPLES; i++) {
      sum += test_random(&random) < 0.3 ? 0 : pow(test_random(&random), 4);
      table.table[i] = sum;
    }
    for (int i = 1; i < CLT_CURVE_SAMPLES; i++) {
      table.table[i] /= sum;
    }
    double before = 0;
    for (int i = 0; i <= 6400; i++) {
      double value = clt_curve_decode(&table, i / 6400.0);
      assert_true(value >= before - 1e-15 && value <= 1);
      assert_true(i % 100 != 0 || fabs(value - table.table[i / 100]) < 1e-14);
      assert_near(clt_curve_decode(&table, clt_curve_encode(&table, i / 6400.0)), i / 6400.0, 1e-12);
      before = value;
    }
    assert_true(clt_curve_decode(&table, 0) == 0 && clt_curve_decode(&table, 1) == 1);
    assert_true(clt_curve_encode(&table, 0) == 0 && clt_curve_encode(&table, 1) == 1);
  }
}

static void broken_tables_are_refused(void **state) {
  (void)state;
  const double codes[] = {0, 0.5, 1}, wrong_codes[] = {0, 0, 1}, light[] = {0, 0.4, 1}, falls[] = {0, 1.2, 1},
               lifted[] = {0.1, 0.4, 1};
  clt_curve curve;
  clt_error error = {0};
  assert_int_equal(clt_curve_from_points(wrong_codes, light, 3, &curve, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_curve_from_points(codes, falls, 3, &curve, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "from (0.5, 1.2) to (1, 1)"));
  assert_int_equal(clt_curve_from_points(codes, lifted, 3, &curve, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_curve_from_points(codes, light, 1, &curve, &error), CLT_BAD_INPUT);
  assert_int_equal(clt_curve_parse("table", &curve, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "calibration"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(srgb_is_the_standards_curve),
      cmocka_unit_test(curves_are_monotone_and_keep_black_and_white),
      cmocka_unit_test(encoding_undoes_decoding),
      cmocka_unit_test(gamma_is_a_power),
      cmocka_unit_test(texts_of_curves_are_read_back),
      cmocka_unit_test(other_texts_are_refused_with_what_is_allowed),
      cmocka_unit_test(tables_follow_what_they_were_made_from),
      cmocka_unit_test(tables_keep_their_order),
      cmocka_unit_test(broken_tables_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
