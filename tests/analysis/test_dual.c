/* The dual photograph: T' by its inner product, by storage kind, and by reciprocity. */
#include "rooms.h"

static void draw(clt_image *image, uint64_t seed) {
  for (size_t i = 0; i < clt_image_size(image); i++) {
    image->data[i] = (float)test_random(&seed);
  }
}

/* sum over cells of a channel of T x times y, from products of the transport. */
static double meet(const clt_transport *transport, int channel, const clt_image *x, const clt_image *y) {
  size_t n = clt_transport_describe(transport).cols;
  double *drive = numbers(n), *seen = numbers(n), sum = 0;
  for (size_t i = 0; i < n; i++) {
    drive[i] = x->data[(size_t)channel * n + i];
  }
  clt_transport_apply(transport, channel, drive, seen);
  for (size_t i = 0; i < n; i++) {
    sum += seen[i] * y->data[(size_t)channel * n + i];
  }
  free(drive);
  free(seen);
  return sum;
}

/* <T x, y> = <x, T' y> */
static void assert_is_dual(const clt_transport *transport, uint64_t seed) {
  clt_transport_info info = clt_transport_describe(transport);
  clt_image x, y, dual;
  clt_error error = {0};
  assert_ok(clt_image_init(&x, info.channels, info.height, info.width, &error), error);
  assert_ok(clt_image_init(&y, info.channels, info.height, info.width, &error), error);
  draw(&x, seed);
  draw(&y, seed + 100);
  assert_ok(clt_dual_photograph(transport, &y, &dual, &error), error);
  for (int c = 0; c < info.channels; c++) {
    double sum = 0, wanted = meet(transport, c, &x, &y);
    for (size_t i = (size_t)c * info.cols; i < (size_t)(c + 1) * info.cols; i++) {
      sum += (double)x.data[i] * (double)dual.data[i];
    }
    assert_near(sum, wanted, 1e-6 * wanted);
  }
  clt_image_finish(&x);
  clt_image_finish(&y);
  clt_image_finish(&dual);
}

static void products_meet_for_any_t(void **state) {
  (void)state;
  clt_error error = {0};
  for (uint64_t seed = 1; seed <= 3; seed++) { /* asymmetric on purpose */
    clt_transport *transport = NULL;
    uint64_t random = seed;
    assert_ok(clt_transport_create_dense(7, 5, 3, 35, &transport, &error), error);
    for (int c = 0; c < 3; c++) {
      for (size_t k = 0; k < 35 * 35; k++) {
        clt_transport_entries(transport, c)[k] = (float)test_random(&random);
      }
    }
    assert_is_dual(transport, seed);
    clt_transport_destroy(transport);
  }
  int64_t start[17];
  int32_t node[48];
  float value[48];
  uint64_t random = 5;
  for (int i = 0; i <= 16; i++) {
    start[i] = 3 * i;
  }
  for (int k = 0; k < 48; k++) { /* own cell, a block, the flood */
    node[k] = k % 3 == 0   ? k / 3
              : k % 3 == 1 ? clt_tree_node(4, 4, 1, k / 3 % 2, k / 24)
                           : clt_tree_node(4, 4, 2, 0, 0);
    value[k] = (float)(0.1 + test_random(&random));
  }
  clt_transport *tree = NULL;
  assert_ok(clt_transport_create_tree(4, 4, 1, 16, start, node, value, &tree, &error), error);
  assert_is_dual(tree, 9);
  clt_transport_destroy(tree);
}

/* A diffuse room is reciprocal: W_i T_ij = W_j T_ji with W the cells' solid angles, which the certificate finds as F /
 * w from T alone. Then T' y = W T (y / W): the dual photograph is the ordinary one under scaled light. */
static void dual_of_a_diffuse_room_is_its_scaled_primal(void **state) {
  (void)state;
  char text[2048];
  static const double albedo[2] = {0.8, 0.5};
  room made = room_write(dihedral_text(text, 32, 24, "[0.44, 0.33]", albedo, ""));
  room_open(&made);
  clt_image light, dual;
  clt_error error = {0};
  size_t n = made.cells;
  const double *first = clt_certificate_first_bounce(made.certificate, 0);
  const double *flux = clt_certificate_flux(made.certificate, 0);
  double *scaled = numbers(n), *seen = numbers(n), *found = numbers(n);
  assert_ok(clt_image_init(&light, 1, 24, 32, &error), error);
  draw(&light, 3);
  for (size_t i = 0; i < n; i++) {
    scaled[i] = light.data[i] * flux[i] / first[i];
  }
  clt_transport_apply(made.transport, 0, scaled, seen);
  assert_ok(clt_dual_photograph(made.transport, &light, &dual, &error), error);
  for (size_t i = 0; i < n; i++) {
    seen[i] *= first[i] / flux[i];
    found[i] = dual.data[i];
  }
  double defect = distance(n, found, seen);
  print_message("T' y against W T (y / W): %.1e\n", defect);
  assert_true(defect < 1e-5);
  clt_transport_apply(made.transport, 0, scaled, seen); /* and not by accident: unscaled they differ */
  assert_true(distance(n, found, seen) > 1e-2);
  clt_image_finish(&light);
  clt_image_finish(&dual);
  free(scaled);
  free(seen);
  free(found);
  room_close(&made);
}

static void what_does_not_fit_is_refused(void **state) {
  (void)state;
  clt_error error = {0};
  clt_transport *tall = NULL, *square = NULL;
  clt_image light, dual;
  assert_ok(clt_transport_create_dense(2, 2, 1, 5, &tall, &error), error);
  assert_ok(clt_transport_create_dense(3, 2, 1, 6, &square, &error), error);
  assert_ok(clt_image_init(&light, 1, 2, 2, &error), error);
  assert_int_equal(clt_dual_photograph(tall, &light, &dual, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "5 cells but drives 4"));
  assert_int_equal(clt_dual_photograph(square, &light, &dual, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "3 x 2"));
  assert_null(dual.data);
  clt_image_finish(&light);
  clt_transport_destroy(tall);
  clt_transport_destroy(square);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(products_meet_for_any_t),
      cmocka_unit_test(dual_of_a_diffuse_room_is_its_scaled_primal),
      cmocka_unit_test(what_does_not_fit_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
