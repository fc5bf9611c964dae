#include "sim/radiosity.h"

#include <omp.h>

#include "base/memory.h"
#include "room.h"
#include "sim/light.h"

/* A shipped scene's description. */
static void read_scene(const char *name, clt_scene_description *description) {
  char path[1024];
  clt_error error = {.status = CLT_OK};
  snprintf(path, sizeof path, "%s/config/scenes/%s.cfg", CLT_SOURCE_ROOT, name);
  *description = (clt_scene_description){0};
  assert_ok(clt_scene_read(path, description, &error), error);
}

/* The same light twice: T as a dense matrix, and by products over a mesh of as many elements. */
typedef struct twins {
  clt_scene_description description;
  clt_transport *dense, *products;
  size_t cells, values;
  double *direct; /* F (1 - black), values */
} twins;

static void light_scene(const char *name, twins *of) {
  clt_error error = {.status = CLT_OK};
  clt_light_facts facts;
  clt_layout layout = {0};
  const clt_mesh_size size = {.wanted = CLT_ELEMENTS_WANTED, .most = CLT_ELEMENTS_MAX};
  read_scene(name, &of->description);
  assert_ok(clt_light_transport(&of->description, &of->dense, &facts, &error), error);
  assert_ok(clt_layout_init(&layout, &of->description, size, &error), error);
  of->cells = (size_t)layout.cells.count;
  of->values = of->cells * (size_t)of->description.channels;
  of->direct = clt_alloc(of->values, sizeof *of->direct);
  for (size_t k = 0; k < of->values; k++) {
    of->direct[k] = (1.0 - of->description.projector.black) * layout.cells.direct[k];
  }
  assert_ok(clt_radiosity_transport(&layout, &of->products, &error), error);
  assert_true(clt_radiosity_is(of->products) && !clt_radiosity_is(of->dense));
}

static void finish(twins *of) {
  clt_transport_destroy(of->dense);
  clt_transport_destroy(of->products);
  clt_scene_description_finish(&of->description);
  free(of->direct);
}

/* rms of the difference of two products over the rms of the bounced light in the first, which is it less F x. */
static double difference(const twins *of, const double *x, const double *one, const double *other) {
  double off = 0.0, bounced = 0.0;
  for (size_t k = 0; k < of->values; k++) {
    double light = one[k] - of->direct[k] * x[k];
    off += (one[k] - other[k]) * (one[k] - other[k]);
    bounced += light * light;
  }
  return sqrt(off / bounced);
}

/* Products with T and T', of white, random and sparse drives, against the dense matrix. Where objects stand in the room
 * either way samples what passes by them, of pairs of elements or of clusters. */
static void products_are_those_of_the_dense_light(void **state) {
  (void)state;
  const struct {
    const char *name;
    double wanted;
  } scenes[] = {{"dihedral", 5e-4}, {"box6", 5e-4}, {"small", 5e-4}, {"cornell", 5e-3}, {"shadow", 5e-3}};
  for (size_t s = 0; s < sizeof scenes / sizeof scenes[0]; s++) {
    twins of;
    light_scene(scenes[s].name, &of);
    double *x = clt_alloc(3 * of.values, sizeof *x), *dense = x + of.values, *products = dense + of.values;
    for (int kind = 0; kind < 3; kind++) {
      uint64_t seed = s + 1;
      for (size_t k = 0; k < of.values; k++) {
        double random = test_random(&seed);
        x[k] = kind == 0 ? 1.0 : kind == 1 ? random : random < 0.01;
      }
      clt_transport_apply_all(of.dense, x, dense);
      clt_transport_apply_all(of.products, x, products);
      double forward = difference(&of, x, dense, products), back = 0.0;
      for (int c = 0; c < of.description.channels; c++) {
        clt_transport_apply_transposed(of.dense, c, &x[(size_t)c * of.cells], &dense[(size_t)c * of.cells]);
        clt_transport_apply_transposed(of.products, c, &x[(size_t)c * of.cells], &products[(size_t)c * of.cells]);
      }
      back = difference(&of, x, dense, products);
      print_message("%s, drive %d: T x %.1e, T' x %.1e off\n", scenes[s].name, kind, forward, back);
      assert_true(forward <= scenes[s].wanted && back <= scenes[s].wanted);
    }
    free(x);
    finish(&of);
  }
}

/* One channel's product is its part of the product of all; sums of rows are the product with 1; and nothing depends on
 * the number of threads. */
static void one_channel_is_a_part_of_all(void **state) {
  (void)state;
  twins of;
  light_scene("cornell", &of);
  double *x = clt_alloc(3 * of.values, sizeof *x), *all = x + of.values, *other = all + of.values;
  uint64_t seed = 7;
  for (size_t k = 0; k < of.values; k++) {
    x[k] = test_random(&seed);
  }
  int threads = omp_get_max_threads();
  clt_transport_apply_all(of.products, x, all);
  for (int count = 1; count <= 4; count++) {
    omp_set_num_threads(count);
    clt_transport_apply_all(of.products, x, other);
    assert_memory_equal(all, other, of.values * sizeof *all);
  }
  omp_set_num_threads(threads);
  for (int c = 0; c < of.description.channels; c++) {
    clt_transport_apply(of.products, c, &x[(size_t)c * of.cells], other);
    assert_memory_equal(other, &all[(size_t)c * of.cells], of.cells * sizeof *all);
  }
  for (size_t k = 0; k < of.values; k++) {
    x[k] = 1.0;
  }
  clt_transport_apply_all(of.products, x, all);
  clt_transport_row_sums(of.products, 1, other);
  assert_memory_equal(other, &all[of.cells], of.cells * sizeof *all);
  free(x);
  finish(&of);
}

/* <T x, y> = <x, T' y>, and the gathered light of sampled cells is the simulated one. */
static void gathered_light_is_the_simulated(void **state) {
  (void)state;
  enum { SAMPLES = 24 };
  twins of;
  light_scene("box5", &of);
  double *x = clt_alloc(4 * of.values, sizeof *x), *y = x + of.values, *tx = y + of.values, *ty = tx + of.values;
  uint64_t seed = 11;
  for (size_t k = 0; k < of.values; k++) {
    x[k] = test_random(&seed);
    y[k] = test_random(&seed);
  }
  clt_transport_apply(of.products, 0, x, tx);
  clt_transport_apply_transposed(of.products, 0, y, ty);
  double one = 0.0, other = 0.0;
  for (size_t i = 0; i < of.cells; i++) {
    one += tx[i] * y[i];
    other += x[i] * ty[i];
  }
  assert_near(one, other, 1e-6 * one);
  int cells[SAMPLES];
  double simulated[3 * SAMPLES], exact[3 * SAMPLES], off = 0.0, size = 0.0;
  clt_error error = {.status = CLT_OK};
  for (int k = 0; k < SAMPLES; k++) {
    cells[k] = k * (int)of.cells / SAMPLES;
  }
  assert_ok(clt_radiosity_gather(of.products, x, cells, SAMPLES, simulated, exact, &error), error);
  for (int k = 0; k < SAMPLES * of.description.channels; k++) {
    off += (simulated[k] - exact[k]) * (simulated[k] - exact[k]);
    size += exact[k] * exact[k];
  }
  print_message("gathered: %.1e off\n", sqrt(off / size));
  assert_true(size > 0.0 && sqrt(off / size) < 2e-4);
  free(x);
  finish(&of);
}

/* A scene of more cells than are held as a matrix opens, is seen by its devices, knows how exact it is, and says why
 * its transport is not saved. */
static void fine_grids_are_scenes_like_others(void **state) {
  (void)state;
  room made;
  room_make(&made, "grid = { width = 128; height = 96; channels = 3; }; projector = { position = [0.06, -3.2, 0.03]; "
                   "target = [0.0, 0.0, 0.0]; tangent = [0.44, 0.33]; intensity = 40.0; }; "
                   "materials = ( { name = \"w\"; albedo = [0.8, 0.6, 0.4]; } ); surfaces = ( "
                   "{ corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"w\"; }, "
                   "{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"w\"; } );");
  clt_scene *scene = room_open(&made);
  clt_error error = {.status = CLT_OK};
  clt_image drive = {0}, seen = {0};
  clt_reference found;
  assert_ok(clt_image_init(&drive, 3, 96, 128, &error), error);
  uint64_t seed = 3;
  for (size_t k = 0; k < clt_image_size(&drive); k++) {
    drive.data[k] = (float)test_random(&seed);
  }
  assert_string_equal(clt_transport_describe(clt_scene_transport(scene)).storage, "radiosity");
  assert_ok(clt_scene_reference(scene, &drive, 16, &found, &error), error);
  print_message("128 x 96: rms %.1e, largest %.1e, bound %.1e\n", found.rms, found.largest, found.bound);
  assert_int_equal(found.cells, 16);
  assert_true(found.rms > 0.0 && found.rms < 2e-4 && found.bound >= found.rms && found.largest >= found.rms);
  assert_ok(clt_scene_appearance(scene, &drive, &seen, &error), error);
  char path[128];
  snprintf(path, sizeof path, "%s/t.h5", made.folder);
  assert_int_equal(clt_transport_save(clt_scene_transport(scene), path, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "acquire it"));
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  clt_scene_close(scene);
  room_remove(&made);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(products_are_those_of_the_dense_light), cmocka_unit_test(one_channel_is_a_part_of_all),
      cmocka_unit_test(gathered_light_is_the_simulated), cmocka_unit_test(fine_grids_are_scenes_like_others)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
