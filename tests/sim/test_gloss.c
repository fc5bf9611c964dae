/* Gloss: the lobe, highlights, and images of other surfaces, each against an independent computation. */
#include "sim/gloss.h"

#include "room.h"
#include "sim/light.h"

static clt_vector direction_at(double theta, double phi) {
  return (clt_vector){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
}

/* Fraction of light from `light` that the lobe sends into the hemisphere: midpoint rule over theta and phi. */
static double fraction_sent(double exponent, clt_vector light) {
  enum { RINGS = 2000, TURNS = 720 };
  double sum = 0.0;
  for (int ring = 0; ring < RINGS; ring++) {
    double theta = (ring + 0.5) / RINGS * M_PI / 2;
    for (int turn = 0; turn < TURNS; turn++) {
      clt_vector view = direction_at(theta, (turn + 0.5) / TURNS * 2 * M_PI);
      sum += clt_gloss_lobe(exponent, (clt_vector){0, 0, 1}, light, view) * cos(theta) * sin(theta);
    }
  }
  return sum * (M_PI / 2 / RINGS) * (2 * M_PI / TURNS);
}

/* All light along the normal comes back, less at a slant, never more; and light and view may be exchanged. */
static void lobe_conserves_energy(void **state) {
  (void)state;
  const double exponents[] = {1, 5, 30, 200, 1000};
  for (int k = 0; k < 5; k++) {
    double before = 1.0;
    assert_near(fraction_sent(exponents[k], (clt_vector){0, 0, 1}), 1.0, 1e-3);
    for (int slant = 1; slant <= 4; slant++) {
      double sent = fraction_sent(exponents[k], direction_at(0.36 * slant, 0.4));
      assert_true(sent <= before + 1e-3 && sent > 0.0);
      before = sent;
    }
  }
  uint64_t random = 3;
  for (int k = 0; k < 200; k++) {
    clt_vector a = direction_at(1.5 * test_random(&random), 6 * test_random(&random));
    clt_vector b = direction_at(1.5 * test_random(&random), 6 * test_random(&random)), normal = {0, 0, 1};
    double there = clt_gloss_lobe(20, normal, a, b);
    assert_near(there, clt_gloss_lobe(20, normal, b, a), 1e-9 * (1 + there));
  }
}

/* The mean of what samples count is the integral of the lobe over the hemisphere, at any slant. */
static void samples_follow_the_lobe(void **state) {
  (void)state;
  enum { SIDE = 120 };
  const double exponents[] = {1, 10, 100};
  for (int k = 0; k < 9; k++) {
    clt_vector view = direction_at(0.1 + 0.5 * (k / 3), 2.0), from;
    double exponent = exponents[k % 3], mean = 0.0, high = 0.0, wanted_high = 0.0;
    for (int n = 0; n < SIDE * SIDE; n++) {
      double counts = clt_gloss_sample(exponent, (clt_vector){0, 0, 1}, view, (n % SIDE + 0.5) / SIDE,
                                       (n / SIDE + 0.5) / SIDE, &from);
      mean += counts / (SIDE * SIDE);
      high += counts * from.x / (SIDE * SIDE);
      double theta = (n % SIDE + 0.5) / SIDE * M_PI / 2;
      clt_vector light = direction_at(theta, (n / SIDE + 0.5) / SIDE * 2 * M_PI);
      wanted_high += clt_gloss_lobe(exponent, (clt_vector){0, 0, 1}, light, view) * light.x * cos(theta) * sin(theta) *
                     M_PI / 2 * 2 * M_PI / (SIDE * SIDE);
    }
    assert_near(mean, fraction_sent(exponent, view), 2e-3);
    assert_near(high, wanted_high, 2e-3);
  }
}

/* A glossy wall of no diffuse reflectance: what is seen of a cell is the mean over its rays of the closed formula. */
static void highlight_on_a_wall(void **state) {
  (void)state;
  const double strength = 0.3, exponents[] = {8, 120};
  for (int k = 0; k < 4; k++) {
    clt_scene_description wall;
    describe_view(&wall, 8, 6, (clt_vector){0.1, -3, 0.2}, (clt_vector){0.1, 0, 0.2});
    add_surface(&wall, (clt_vector){-2, 0, -2}, (clt_vector){4, 0, 0}, (clt_vector){0, 0, 4}, 0.4);
    wall.gloss[0] = (clt_gloss){{strength, strength, strength}, exponents[k % 2]};
    clt_vector eye = wall.projector.pinhole.position;
    if (k >= 2) {
      eye = (clt_vector){1.2, -2, -0.3};
      wall.camera.placed = true;
      wall.camera.pinhole = (clt_pinhole){.position = eye, .tangent = {4, 4}};
      assert_true(clt_pinhole_aim(&wall.camera.pinhole, (clt_vector){0, 0, 0}, (clt_vector){0, 0, 1}));
    }
    clt_light light = {0};
    clt_error error = {.status = CLT_OK};
    assert_ok(clt_light_init(&light, &wall, &error), error);
    assert_int_equal(light.layout.mesh.count, 0);
    double brightest = 0.0, darkest = INFINITY;
    for (int cell = 0; cell < 48; cell++) {
      double sum = 0.0, share = 0.0;
      for (int ray = 0; ray < 16; ray++) {
        double omega;
        clt_vector d = clt_scene_ray(&wall, cell, ray, &omega);
        clt_vector p = {0.1 + 3 * d.x / d.y, 0, 0.2 + 3 * d.z / d.y};
        double r = sqrt(vec_dot(vec_sub(p, (clt_vector){0.1, -3, 0.2}), vec_sub(p, (clt_vector){0.1, -3, 0.2})));
        /* the mirror image of the projector lies at y = +3; its ray goes on to -y */
        clt_vector out = vec_scale(1 / r, (clt_vector){p.x - 0.1, -3, p.z - 0.2});
        clt_vector view = vec_unit(vec_sub(eye, p));
        double cosine = fmax(0.0, vec_dot(out, view)), n = exponents[k % 2];
        double brdf = 0.4 / M_PI + strength * (n + 2) / (2 * M_PI) * pow(cosine, n);
        sum += omega * brdf * 10.0 * 3.0 / (r * r * r);
        share += omega;
      }
      assert_near(clt_light_direct(&light, 0, cell), sum / share, 1e-12 * sum / share);
      brightest = fmax(brightest, sum / share);
      darkest = fmin(darkest, sum / share);
    }
    assert_true(k % 2 == 0 || brightest > 3 * darkest); /* there is a highlight */
    clt_light_finish(&light);
    clt_scene_description_finish(&wall);
  }
}

/* Wall x = 0 with gloss and wall y = 0 without, at a right angle, both reflecting towards +x +y. */
static void describe_glossy_dihedral(clt_scene_description *walls, double exponent, double strength) {
  describe_view(walls, 10, 8, (clt_vector){2.2, 2.4, 1}, (clt_vector){0.4, 0.4, 1});
  add_surface(walls, (clt_vector){0, 0, 0}, (clt_vector){0, 1.8, 0}, (clt_vector){0, 0, 2}, 0.2);
  add_surface(walls, (clt_vector){0, 0, 0}, (clt_vector){0, 0, 2}, (clt_vector){1.8, 0, 0}, 0.6);
  walls->surfaces[0].material = 1;
  walls->gloss[1] = (clt_gloss){{strength, strength, strength}, exponent};
}

/* Row sums of T of a description: what a fully lit cell shows. */
static void seen_in_white(const clt_scene_description *description, double *sums) {
  clt_transport *transport = NULL;
  clt_light_facts facts;
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_transport(description, &transport, &facts, &error), error);
  clt_transport_row_sums(transport, 0, sums);
  clt_transport_destroy(transport);
}

/* Direct radiance of the white wall y = 0 at x, z under full drive: what the projector lights of it. */
static double lit_radiance(const clt_scene_description *walls, double x, double z) {
  clt_vector from = walls->projector.pinhole.position, way = vec_sub((clt_vector){x, 0, z}, from);
  double r = vec_length(way);
  return clt_pinhole_covers(&walls->projector.pinhole, (clt_vector){x, 0, z}) ? 0.6 / M_PI * 10.0 * from.y / (r * r * r)
                                                                              : 0.0;
}

/* What the gloss of wall x = 0 at a place throws to the eye of the white wall's direct light: integral over that wall
 * of lobe * radiance * cos cos / r^2, by the midpoint rule. */
static double mirrored_light(const clt_scene_description *walls, clt_vector at, double exponent, double strength) {
  enum { SIDE = 120 };
  clt_vector normal = {1, 0, 0}, view = vec_unit(vec_sub(walls->projector.pinhole.position, at));
  double sum = 0.0;
  for (int n = 0; n < SIDE * SIDE; n++) {
    double x = (n % SIDE + 0.5) / SIDE * 1.8, z = (n / SIDE + 0.5) / SIDE * 2.0;
    clt_vector way = vec_sub((clt_vector){x, 0, z}, at), light = vec_unit(way);
    double geometry = light.x * -light.y / vec_dot(way, way);
    sum += clt_gloss_lobe(exponent, normal, light, view) * geometry * lit_radiance(walls, x, z);
  }
  return strength * sum * 1.8 * 2.0 / (SIDE * SIDE);
}

/* What gloss adds to the cells of the glossy wall beside the highlight is the other wall's light, thrown by the lobe.
 * Walls that only once reflect light diffusely: the glossy wall has no diffuse reflectance. */
static void walls_mirror_each_other(void **state) {
  (void)state;
  const double strength = 0.4, exponents[] = {10, 60};
  for (int k = 0; k < 2; k++) {
    clt_scene_description walls;
    describe_glossy_dihedral(&walls, exponents[k], strength);
    walls.surfaces[0].albedo[0] = 0.0;
    walls.rays = 16;
    clt_light light = {0};
    clt_error error = {.status = CLT_OK};
    assert_ok(clt_light_init(&light, &walls, &error), error);
    double sums[80], off = 0.0, size = 0.0;
    seen_in_white(&walls, sums);
    for (int cell = 0; cell < 80; cell++) {
      clt_ray_end ends[CLT_CELL_RAYS_MAX];
      double wanted = 0.0;
      bool whole = true;
      clt_cell_trace(&walls, light.layout.visibility, cell, ends);
      for (int ray = 0; ray < 256; ray++) {
        whole = whole && ends[ray].surface == 0;
      }
      /* every other ray of every other row, in turn, so that their mean place is the cell's middle */
      for (int n = 0; n < 64 && whole && cell % 3 == 0; n++) {
        int ray = (2 * (n / 8) + n % 2) * 16 + 2 * (n % 8) + n / 8 % 2;
        wanted += mirrored_light(&walls, ends[ray].at, exponents[k], strength) / 64;
      }
      if (whole && cell % 3 == 0) {
        double found = sums[cell] - clt_light_direct(&light, 0, cell);
        off += (found - wanted) * (found - wanted);
        size += wanted * wanted;
      }
    }
    print_message("exponent %g: images of the other wall differ by %.2f %%\n", exponents[k], 100 * sqrt(off / size));
    assert_true(size > 0.0 && sqrt(off / size) < 0.02);
    clt_light_finish(&light);
    clt_scene_description_finish(&walls);
  }
}

/* A very sharp lobe is a mirror: strength times the radiance where the mirrored ray from the eye meets the other wall.
 */
static void sharp_gloss_is_a_mirror(void **state) {
  (void)state;
  const double strength = 0.4;
  clt_scene_description walls;
  describe_glossy_dihedral(&walls, 50000, strength);
  walls.surfaces[0].albedo[0] = 0.0;
  walls.rays = 16;
  clt_light light = {0};
  clt_error error = {.status = CLT_OK};
  assert_ok(clt_light_init(&light, &walls, &error), error);
  double sums[80], off = 0.0, size = 0.0;
  seen_in_white(&walls, sums);
  int mirrors = 0;
  for (int cell = 0; cell < 80; cell++) {
    clt_ray_end ends[CLT_CELL_RAYS_MAX];
    clt_vector eye = walls.projector.pinhole.position;
    double wanted = 0.0;
    int bright = 0;
    clt_cell_trace(&walls, light.layout.visibility, cell, ends);
    for (int ray = 0; ray < 256; ray++) {
      clt_vector way = vec_sub(ends[ray].at, eye);
      way.x = -way.x;
      double distance = ends[ray].at.y / -way.y;
      clt_vector met = vec_along(ends[ray].at, distance, way, 0, way);
      double cosine = way.x / vec_length(way);
      double radiance = ends[ray].surface == 0 && distance > 0 && met.x < 1.8 && met.z > 0 && met.z < 2
                            ? lit_radiance(&walls, met.x, met.z)
                            : 0.0;
      wanted += strength * cosine * radiance * ends[ray].share;
      bright += radiance > 0.0;
    }
    if (bright == 256) { /* the whole cell shows what is lit of the other wall */
      double found = sums[cell] - clt_light_direct(&light, 0, cell);
      off += (found - wanted) * (found - wanted);
      size += wanted * wanted;
      mirrors++;
    }
  }
  print_message("%d cells differ from a mirror by %.2f %%\n", mirrors, 100 * sqrt(off / size));
  assert_true(mirrors >= 4 && sqrt(off / size) < 0.02);
  clt_light_finish(&light);
  clt_scene_description_finish(&walls);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(lobe_conserves_energy),   cmocka_unit_test(samples_follow_the_lobe),
      cmocka_unit_test(highlight_on_a_wall),     cmocka_unit_test(walls_mirror_each_other),
      cmocka_unit_test(sharp_gloss_is_a_mirror),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
