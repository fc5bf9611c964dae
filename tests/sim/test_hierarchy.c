#include "sim/hierarchy.h"

#include <omp.h>

#include "base/memory.h"
#include "support.h"

/* Walls divided into squares of about one side, and their H as a hierarchy and perhaps entry by entry. */
typedef struct box {
  clt_rectangle surfaces[16], *elements;
  int surface_count, count, *surface;
  clt_hierarchy *hierarchy;
  double *exchange;
  clt_lanes *x, *y, *work;
} box;

static void add_wall(box *made, clt_vector corner, clt_vector u, clt_vector v, bool triangle) {
  clt_rectangle *wall = &made->surfaces[made->surface_count++];
  *wall = (clt_rectangle){.corner = corner, .u = u, .v = v, .triangle = triangle};
  assert_true(clt_rectangle_complete(wall));
}

/* The six sides of a block, facing out, or in. */
static void add_block(box *made, clt_vector corner, clt_vector u, clt_vector v, clt_vector w, bool inwards) {
  const clt_vector far = vec_add(vec_add(corner, u), vec_add(v, w)), edge[3] = {u, v, w};
  for (int k = 0; k < 3; k++) {
    clt_vector a = edge[k], b = edge[(k + 1) % 3];
    add_wall(made, corner, inwards ? a : b, inwards ? b : a, false);
    add_wall(made, far, vec_scale(-1.0, inwards ? b : a), vec_scale(-1.0, inwards ? a : b), false);
  }
}

/* Squares, or triangles two of which make one. */
static void divide(box *made, double side) {
  for (int fill = 0; fill < 2; fill++) {
    made->count = 0;
    for (int s = 0; s < made->surface_count; s++) {
      const clt_rectangle *whole = &made->surfaces[s];
      int across = (int)ceil(vec_length(whole->u) / side - 1e-9), down = (int)ceil(vec_length(whole->v) / side - 1e-9);
      across = whole->triangle && down > across ? down : across;
      down = whole->triangle ? across : down;
      for (int k = 0; k < 2 * across * down; k++) {
        int column = k / 2 % across, row = k / 2 / across, turned = k % 2;
        bool outside = whole->triangle ? column + row + turned >= across : turned != 0;
        if (fill && !outside) {
          clt_rectangle *part = &made->elements[made->count];
          *part = *whole;
          part->u = vec_scale((turned ? -1.0 : 1.0) / across, whole->u);
          part->v = vec_scale((turned ? -1.0 : 1.0) / down, whole->v);
          part->corner = vec_along(whole->corner, (column + turned) / (double)across, whole->u,
                                   (row + turned) / (double)down, whole->v);
          made->surface[made->count] = s;
        }
        made->count += !outside;
      }
    }
    if (!fill) {
      made->elements = clt_alloc((size_t)made->count, sizeof *made->elements);
      made->surface = clt_alloc((size_t)made->count, sizeof *made->surface);
      assert_true(made->elements && made->surface);
    }
  }
}

static void compute(box *made, double side, double tolerance, bool dense) {
  clt_error error = {.status = CLT_OK};
  clt_visibility *visibility = NULL;
  divide(made, side);
  size_t count = (size_t)made->count;
  assert_ok(clt_visibility_create(made->surfaces, made->surface_count, &visibility, &error), error);
  clt_parts parts = {made->surfaces, made->elements, made->surface, made->surface_count, made->count, visibility};
  assert_ok(clt_hierarchy_create(&parts, tolerance, &made->hierarchy, &error), error);
  made->x = clt_alloc(2 * count + clt_hierarchy_work(made->hierarchy), sizeof *made->x);
  assert_non_null(made->x);
  made->y = made->x + count;
  made->work = made->y + count;
  if (dense) {
    made->exchange = clt_alloc(count * count, sizeof *made->exchange);
    assert_non_null(made->exchange);
    assert_ok(clt_exchange_compute(&parts, made->exchange, &error), error);
  }
  clt_visibility_destroy(visibility);
}

static void destroy(box *made) {
  clt_hierarchy_destroy(made->hierarchy);
  free(made->elements);
  free(made->surface);
  free(made->exchange);
  free(made->x);
}

/* One lane of ones, one that varies smoothly, one of random values, one that is nearly empty. */
static void choose_vectors(const box *of, uint64_t seed) {
  const int *order = clt_hierarchy_order(of->hierarchy);
  double wave[3] = {5.0 * test_random(&seed), 5.0 * test_random(&seed), 5.0 * test_random(&seed)};
  for (int k = 0; k < of->count; k++) {
    clt_vector at = clt_rectangle_centre(&of->elements[order[k]]);
    double smooth = 0.6 + 0.4 * sin(wave[0] * at.x + wave[1] * at.y + wave[2] * at.z);
    of->x[k] = (clt_lanes){1.0f, (float)smooth, (float)test_random(&seed), (float)(test_random(&seed) < 0.01)};
  }
}

/* Errors of H x by area, of one lane, over the rms of the true one: rms and largest. */
static void compare_with_dense(const box *of, int lane, double *rms, double *worst) {
  const int *order = clt_hierarchy_order(of->hierarchy);
  double error = 0.0, size = 0.0;
  *worst = 0.0;
  for (int i = 0; i < of->count; i++) {
    double sum = 0.0, area = clt_rectangle_area(&of->elements[order[i]]);
    for (int j = 0; j < of->count; j++) {
      sum += clt_exchange_between(of->exchange, of->count, order[i], order[j]) * (double)of->x[j][lane];
    }
    double off = ((double)of->y[i][lane] - sum) / area;
    error += off * off;
    size += sum * sum / (area * area);
    *worst = fmax(*worst, fabs(off));
  }
  *rms = sqrt(error / size);
  *worst /= sqrt(size / of->count);
}

/* Even, smooth and random light to `wanted`, a few bright spots, of which single elements see most, to ten times that.
 */
static void assert_like_dense(box *of, uint64_t seed, double wanted) {
  choose_vectors(of, seed);
  clt_hierarchy_product(of->hierarchy, of->x, of->y, of->work);
  for (int lane = 0; lane < CLT_LANES; lane++) {
    double rms, worst;
    compare_with_dense(of, lane, &rms, &worst);
    print_message("%d elements, lane %d: rms %.1e, worst %.1e\n", of->count, lane, rms, worst);
    assert_true(rms <= (lane < 3 ? wanted : 5.0 * wanted));
    assert_true(worst <= (lane < 3 ? 10.0 * wanted : 100.0 * wanted));
  }
}

static const clt_vector e_x = {1, 0, 0}, e_y = {0, 1, 0}, e_z = {0, 0, 1};

/* Two walls at a right angle, turned and stretched by chance. */
static void add_dihedral(box *made, uint64_t seed) {
  double turn = 2.0 * M_PI * test_random(&seed), lean = 0.2 * test_random(&seed), height = 1.5 + test_random(&seed);
  clt_vector one = {cos(turn), sin(turn), lean * cos(turn)}, up = {-lean, 0.0, 1.0};
  clt_vector other = vec_scale(0.8 + 0.4 * test_random(&seed), vec_unit(vec_cross(up, one)));
  add_wall(made, (clt_vector){0, 0, 0}, vec_scale(height, vec_unit(up)), vec_unit(one), false);
  add_wall(made, (clt_vector){0, 0, 0}, other, vec_scale(height, vec_unit(up)), false);
}

static void open_walls(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    box room = {.count = 0};
    add_dihedral(&room, seed);
    compute(&room, 0.045, 1e-4, true);
    assert_like_dense(&room, seed, 2e-4);
    destroy(&room);
  }
}

static void closed_room(void **state) {
  (void)state;
  box room = {.count = 0};
  add_block(&room, (clt_vector){0, 0, 0}, e_x, vec_scale(1.3, e_y), vec_scale(0.8, e_z), true);
  compute(&room, 0.06, 1e-4, true);
  assert_like_dense(&room, 5, 2e-4);
  destroy(&room);
}

/* An object in the middle takes light from its walls. Its sides lie between elements of the walls, so that no element
 * reaches behind one: of such, sampled visibility and form factors each leave a part out. */
static void room_with_an_object(void **state) {
  (void)state;
  box room = {.count = 0};
  add_block(&room, (clt_vector){0, 0, 0}, e_x, e_y, e_z, true);
  add_block(&room, (clt_vector){0.25, 0.375, 0.25}, vec_scale(0.25, e_x), vec_scale(0.25, e_y), vec_scale(0.5, e_z),
            false);
  compute(&room, 0.0625, 1e-4, true);
  assert_like_dense(&room, 6, 2e-4);
  destroy(&room);
}

/* Walls of triangles: a tent over a floor. */
static void triangles(void **state) {
  (void)state;
  box tent = {.count = 0};
  const clt_vector top = {0.4, 0.5, 0.9}, corner[4] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  add_wall(&tent, corner[0], e_x, e_y, false);
  for (int k = 0; k < 4; k++) {
    clt_vector from = corner[k];
    add_wall(&tent, from, vec_sub(top, from), vec_sub(corner[(k + 1) % 4], from), true);
  }
  compute(&tent, 0.06, 1e-4, true);
  assert_like_dense(&tent, 7, 2e-4);
  destroy(&tent);
}

/* A wanted error is kept, and a smaller one costs more. */
static void tolerances(void **state) {
  (void)state;
  size_t values = 0;
  for (double tolerance = 3e-3; tolerance > 2e-5; tolerance *= 0.1) {
    box room = {.count = 0};
    add_dihedral(&room, 9);
    compute(&room, 0.05, tolerance, true);
    assert_like_dense(&room, 9, 2.0 * tolerance);
    clt_hierarchy_size size = clt_hierarchy_measure(room.hierarchy);
    assert_true(size.bytes > values);
    values = size.bytes;
    destroy(&room);
  }
}

/* <u, H v> = <H u, v>, and H v > 0 for v > 0. */
static void symmetry(void **state) {
  (void)state;
  box room = {.count = 0};
  add_block(&room, (clt_vector){0, 0, 0}, e_x, vec_scale(1.3, e_y), vec_scale(0.8, e_z), true);
  compute(&room, 0.03, 1e-4, false);
  choose_vectors(&room, 11);
  clt_hierarchy_product(room.hierarchy, room.x, room.y, room.work);
  double one = 0.0, other = 0.0;
  for (int k = 0; k < room.count; k++) {
    one += (double)room.x[k][1] * (double)room.y[k][2];
    other += (double)room.y[k][1] * (double)room.x[k][2];
    assert_true(room.y[k][0] > 0.0f && room.y[k][1] > 0.0f && room.y[k][2] > 0.0f);
  }
  assert_near(one, other, 1e-6 * one);
  destroy(&room);
}

/* Radiosity B = 1 + m G B in a closed room, solved here by its series, is 1 / (1 - m); each lane has an m of its own.
 */
static void furnace(void **state) {
  (void)state;
  const clt_lanes albedo = {0.3f, 0.62f, 0.9f, 0.0f};
  box room = {.count = 0};
  add_block(&room, (clt_vector){0, 0, 0}, e_x, e_y, e_z, true);
  add_block(&room, (clt_vector){0.3, 0.35, 0.2}, vec_scale(0.3, e_x), vec_scale(0.3, e_y), vec_scale(0.4, e_z), false);
  compute(&room, 0.0625, 1e-4, false);
  const int *order = clt_hierarchy_order(room.hierarchy);
  for (int k = 0; k < room.count; k++) {
    room.x[k] = (clt_lanes){1.0f, 1.0f, 1.0f, 1.0f};
  }
  for (int step = 0; step < 200; step++) {
    clt_hierarchy_product(room.hierarchy, room.x, room.y, room.work);
    for (int k = 0; k < room.count; k++) {
      room.x[k] = 1.0f + albedo * room.y[k] / (float)clt_rectangle_area(&room.elements[order[k]]);
    }
  }
  for (int k = 0; k < room.count; k++) {
    for (int lane = 0; lane < CLT_LANES; lane++) {
      assert_near((double)room.x[k][lane] * (1.0 - (double)albedo[lane]), 1.0, 1e-4);
    }
  }
  destroy(&room);
}

static void same_for_any_number_of_threads(void **state) {
  (void)state;
  box rooms[3] = {{.count = 0}};
  int most = omp_get_max_threads();
  for (int k = 0; k < 3; k++) {
    omp_set_num_threads(1 << k);
    add_block(&rooms[k], (clt_vector){0, 0, 0}, e_x, e_y, e_z, true);
    add_block(&rooms[k], (clt_vector){0.3, 0.35, 0.2}, vec_scale(0.3, e_x), vec_scale(0.3, e_y), vec_scale(0.4, e_z),
              false);
    compute(&rooms[k], 0.0625, 1e-4, false);
    choose_vectors(&rooms[k], 3);
    clt_hierarchy_product(rooms[k].hierarchy, rooms[k].x, rooms[k].y, rooms[k].work);
    assert_int_equal(memcmp(rooms[0].y, rooms[k].y, (size_t)rooms[0].count * sizeof *rooms[0].y), 0);
  }
  omp_set_num_threads(most);
  for (int k = 0; k < 3; k++) {
    destroy(&rooms[k]);
  }
}

/* Four times the elements take no more than four times the memory, which is what a product reads, and half as much
 * again. */
static void linear_growth(void **state) {
  (void)state;
  size_t before = 0;
  for (double side = 0.036; side > 0.008; side *= 0.5) {
    box room = {.count = 0};
    add_wall(&room, (clt_vector){0, 0, 0}, vec_scale(1.77, e_x), vec_scale(2.6, e_z), false);
    add_wall(&room, (clt_vector){0, 0, 0}, vec_scale(2.6, e_z), vec_scale(1.77, e_y), false);
    compute(&room, side, 1e-4, false);
    size_t bytes = clt_hierarchy_measure(room.hierarchy).bytes;
    print_message("%d elements: %.1f MiB\n", room.count, (double)bytes / 0x1p20);
    assert_true(before == 0 || bytes < 4 * before);
    before = bytes;
    destroy(&room);
  }
}

static void nothing_to_exchange(void **state) {
  (void)state;
  box wall = {.count = 0};
  add_wall(&wall, (clt_vector){0, 0, 0}, e_x, e_y, false);
  compute(&wall, 0.1, 1e-4, false);
  assert_true(clt_hierarchy_is_empty(wall.hierarchy));
  choose_vectors(&wall, 1);
  clt_hierarchy_product(wall.hierarchy, wall.x, wall.y, wall.work);
  for (int k = 0; k < wall.count; k++) {
    assert_near((double)wall.y[k][0], 0.0, 0.0);
  }
  destroy(&wall);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(open_walls),
      cmocka_unit_test(closed_room),
      cmocka_unit_test(room_with_an_object),
      cmocka_unit_test(triangles),
      cmocka_unit_test(tolerances),
      cmocka_unit_test(symmetry),
      cmocka_unit_test(furnace),
      cmocka_unit_test(same_for_any_number_of_threads),
      cmocka_unit_test(linear_growth),
      cmocka_unit_test(nothing_to_exchange),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
