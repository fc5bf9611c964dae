#include "sim/visibility.h"
#include "support.h"

enum { SURFACES = 40, RAYS = 20000 };

static clt_vector random_vector(uint64_t *random, double size) {
  double x = test_random(random), y = test_random(random), z = test_random(random);
  return (clt_vector){size * (2.0 * x - 1.0), size * (2.0 * y - 1.0), size * (2.0 * z - 1.0)};
}

/* A heap of plates in a cube of side 4. */
static void strew(clt_rectangle *plates, uint64_t *random) {
  for (int k = 0; k < SURFACES; k++) {
    clt_vector u = random_vector(random, 1.0);
    clt_vector v = vec_scale(0.7, vec_unit(vec_cross(u, random_vector(random, 1.0))));
    plates[k] = (clt_rectangle){.corner = random_vector(random, 2.0), .u = u, .v = v};
    assert_true(clt_rectangle_complete(&plates[k]));
  }
}

/* Embree's rays meet what trying every surface in double meets, but for rays that graze an edge. */
static void rays_agree_with_the_definition(void **state) {
  (void)state;
  uint64_t random = 5;
  clt_rectangle plates[SURFACES];
  strew(plates, &random);
  clt_error error = {.status = CLT_OK};
  clt_visibility *visibility = NULL;
  assert_ok(clt_visibility_create(plates, SURFACES, &visibility, &error), error);
  int met = 0, blocked = 0, differ = 0;
  for (int k = 0; k < RAYS; k++) {
    int a = k % SURFACES, b = (k / SURFACES + a + 1) % SURFACES;
    double s = test_random(&random), t = test_random(&random);
    clt_vector from = vec_along(plates[a].corner, s, plates[a].u, t, plates[a].v);
    clt_vector to = vec_along(plates[b].corner, t, plates[b].u, s, plates[b].v);
    clt_vector direction = random_vector(&random, 1.0);
    clt_hit wanted = clt_first_hit(plates, SURFACES, from, direction, a);
    clt_hit hit = clt_visibility_first_hit(visibility, from, direction, a);
    bool cut = clt_segment_blocked(plates, SURFACES, from, to, a, b);
    differ += hit.surface != wanted.surface || cut != clt_visibility_blocked(visibility, from, to, a, b);
    met += wanted.surface >= 0;
    blocked += cut;
    if (hit.surface >= 0 && hit.surface == wanted.surface) {
      assert_near(hit.distance, wanted.distance, 1e-12 * wanted.distance);
      assert_near(hit.s + hit.t, wanted.s + wanted.t, 1e-12);
      assert_true(hit.front == wanted.front);
    }
  }
  clt_visibility_destroy(visibility);
  print_message("of %d rays %d met something, %d were blocked, %d differ\n", RAYS, met, blocked, differ);
  assert_true(met > RAYS / 5 && met < RAYS && blocked > RAYS / 5 && blocked < RAYS);
  assert_true(differ <= 2);
}

/* What touches the ends of a segment does not stand between them; what is just beyond does not either. */
static void ends_do_not_block(void **state) {
  (void)state;
  clt_rectangle plates[SURFACES];
  for (int k = 0; k < SURFACES; k++) {
    plates[k] = (clt_rectangle){.corner = {-1, -1, k}, .u = {2, 0, 0}, .v = {0, 2, 0}};
    assert_true(clt_rectangle_complete(&plates[k]));
  }
  clt_error error = {.status = CLT_OK};
  clt_visibility *visibility = NULL;
  assert_ok(clt_visibility_create(plates, SURFACES, &visibility, &error), error);
  for (int k = 0; k + 2 < SURFACES; k++) {
    clt_vector from = {0.1, 0.2, k}, next = {-0.3, 0.5, k + 1}, after = {0.4, -0.7, k + 2};
    assert_false(clt_visibility_blocked(visibility, from, next, k, k + 1));
    assert_true(clt_visibility_blocked(visibility, from, after, k, k + 2));
    clt_hit up = clt_visibility_first_hit(visibility, from, (clt_vector){0, 0, 2}, k);
    assert_int_equal(up.surface, k + 1);
    assert_near(up.distance, 0.5, 1e-12);
    assert_false(up.front);
  }
  clt_visibility_destroy(visibility);
  clt_visibility_destroy(NULL);
}

/* Segments that are traced together are blocked as those that are traced alone, by Embree and without. */
static void segments_together(void **state) {
  (void)state;
  uint64_t random = 9;
  clt_rectangle plates[SURFACES];
  strew(plates, &random);
  for (int count = 6; count <= SURFACES; count += SURFACES - 6) {
    clt_error error = {.status = CLT_OK};
    clt_visibility *visibility = NULL;
    assert_ok(clt_visibility_create(plates, count, &visibility, &error), error);
    int open = 0, differ = 0, pairs = 0;
    for (int n = 0; n < 1000; n++, pairs++) {
      int a = n % count, b = (n / count + a + 1) % count, alone = 0;
      clt_vector from[CLT_SEGMENTS], to[CLT_SEGMENTS];
      for (int k = 0; k < CLT_SEGMENTS; k++) {
        from[k] = clt_rectangle_point(&plates[a], test_random(&random), test_random(&random));
        to[k] = clt_rectangle_point(&plates[b], test_random(&random), test_random(&random));
        alone += !clt_visibility_blocked(visibility, from[k], to[k], a, b);
      }
      int together = clt_visibility_open(visibility, from, to, a, b);
      differ += abs(together - alone);
      open += together;
    }
    clt_visibility_destroy(visibility);
    assert_true(open > pairs && open < CLT_SEGMENTS * pairs);
    assert_true(differ <= 2);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(rays_agree_with_the_definition),
      cmocka_unit_test(ends_do_not_block),
      cmocka_unit_test(segments_together),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
