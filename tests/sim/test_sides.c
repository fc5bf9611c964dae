#include "sim/sides.h"

#include "support.h"

static clt_vector random_vector(uint64_t *random, double size) {
  double x = test_random(random), y = test_random(random), z = test_random(random);
  return (clt_vector){size * (2.0 * x - 1.0), size * (2.0 * y - 1.0), size * (2.0 * z - 1.0)};
}

/* A heap of rectangles and triangles in a cube; every fifth shares a plane or an edge with the one before. */
static void strew(clt_rectangle *pieces, int count, uint64_t *random) {
  for (int k = 0; k < count; k++) {
    clt_vector u = random_vector(random, 1.0), v = vec_unit(vec_cross(u, random_vector(random, 1.0)));
    pieces[k] = (clt_rectangle){.corner = random_vector(random, 2.0), .u = u, .v = v, .triangle = k % 3 == 0};
    if (k % 5 == 4) {
      pieces[k].corner = vec_add(pieces[k - 1].corner, pieces[k - 1].u);
      pieces[k].u = k % 2 == 0 ? pieces[k - 1].u : v;
      pieces[k].v = k % 2 == 0 ? pieces[k - 1].v : vec_cross(v, random_vector(random, 1.0));
    }
    assert_true(clt_rectangle_complete(&pieces[k]));
  }
}

/* All but the last three become tangent to a ball, so that only those three part others. */
static void roll(clt_rectangle *pieces, int count, uint64_t *random) {
  for (int k = 0; k < count - 3; k++) {
    clt_vector out = vec_unit(random_vector(random, 1.0));
    clt_vector u = vec_scale(0.1, vec_unit(vec_cross(out, random_vector(random, 1.0))));
    pieces[k] = (clt_rectangle){.corner = vec_scale(4.0, out), .u = u, .v = vec_cross(out, u)};
    assert_true(clt_rectangle_complete(&pieces[k]));
  }
}

/* For every pair the answer is that of looking at every surface. Counts around 64 and 128 end words of bits. */
static void pairs_are_as_by_definition(void **state) {
  (void)state;
  const int counts[] = {7, 63, 64, 65, 128, 150};
  uint64_t random = 3;
  for (size_t n = 0; n < 2 * sizeof counts / sizeof counts[0]; n++) {
    clt_rectangle pieces[150];
    int count = counts[n / 2], parted = 0, open = 0;
    strew(pieces, count, &random);
    if (n % 2 == 1) {
      roll(pieces, count, &random);
    }
    clt_error error = {.status = CLT_OK};
    clt_sides *sides = NULL;
    assert_ok(clt_sides_create(pieces, count, pieces, count, &sides, &error), error);
    for (int a = 0; a < count; a++) {
      for (int b = 0; b < count; b++) {
        bool face = clt_sides_in_front(sides, a, b) && clt_sides_in_front(sides, b, a);
        bool between = clt_sides_may_be_parted(sides, a, b, a, b);
        assert_true(face == clt_rectangles_face(&pieces[a], &pieces[b]));
        assert_true(between == clt_rectangles_may_be_parted(pieces, count, a, b));
        parted += between;
        open += !between;
      }
    }
    clt_sides_destroy(sides);
    assert_true(parted > 0 && (open > 0 || n % 2 == 0));
  }
  clt_sides_destroy(NULL);
}

/* Parts of surfaces: the answer is that of the surfaces with a and b replaced by their parts. */
static void parts_are_as_by_definition(void **state) {
  (void)state;
  enum { COUNT = 70, PARTS = 4 * COUNT };
  uint64_t random = 8;
  clt_rectangle surfaces[COUNT], parts[PARTS], changed[COUNT];
  strew(surfaces, COUNT, &random);
  for (int k = 0; k < COUNT; k++) {
    surfaces[k].corner = vec_scale(k % 2 == 0 ? 10.0 : 0.1, surfaces[k].corner); /* many planes cut nothing */
  }
  for (int k = 0; k < PARTS; k++) {
    const clt_rectangle *whole = &surfaces[k / 4];
    parts[k] = *whole;
    parts[k].u = vec_scale(0.5, whole->u);
    parts[k].v = vec_scale(0.5, whole->v);
    parts[k].corner = vec_along(whole->corner, k % 2, parts[k].u, k / 2 % 2, parts[k].v);
  }
  clt_error error = {.status = CLT_OK};
  clt_sides *sides = NULL;
  assert_ok(clt_sides_create(surfaces, COUNT, parts, PARTS, &sides, &error), error);
  for (int n = 0; n < 20000; n++) {
    int i = (int)(test_random(&random) * PARTS), j = (int)(test_random(&random) * PARTS), a = i / 4, b = j / 4;
    memcpy(changed, surfaces, sizeof changed);
    changed[a] = parts[i];
    changed[b] = parts[j];
    if (a != b) {
      assert_true(clt_sides_may_be_parted(sides, i, j, a, b) == clt_rectangles_may_be_parted(changed, COUNT, a, b));
      assert_true(clt_sides_in_front(sides, i, b) == ((clt_rectangle_sides(&surfaces[b], &parts[i]) & 1) != 0));
    }
  }
  clt_sides_destroy(sides);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(pairs_are_as_by_definition),
      cmocka_unit_test(parts_are_as_by_definition),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
