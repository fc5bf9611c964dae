/* Moving pictures on the simulated projector, judged by the scene's exact light, in double. */
#include "counterlight/frames.h"

#include <lapacke.h>
#include <malloc.h>

#include "counterlight/device.h"
#include "counterlight/scene.h"
#include "support.h"

enum { W = 16, H = 12, C = 3, N = W * H, CW = 64, CH = 48, SCENE = 24 };

static const char room[] =
    "grid = { width = 16; height = 12; channels = 3; };\n"
    "projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.44, 0.33]; intensity = 40.0;\n"
    "              response = \"srgb\"; bits = 12; black = 0.001; };\n"
    "ambient = 0.002;\n"
    "materials = ( { name = \"warm\"; albedo = [0.8, 0.7, 0.6]; } );\n"
    "surfaces = (\n"
    "  { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"warm\"; },\n"
    "  { corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"warm\"; });\n";

typedef struct stage {
  clt_scene *scene;
  const clt_transport *transport;
  clt_certificate *certificate;
  clt_frames *frames;
  float gain[C * N], offset[C * N];
  uint8_t content[CW * CH * 3];
} stage;

static clt_scene *open_room(void) {
  char folder[64], path[96];
  clt_scene *scene = NULL;
  clt_error error = {0};
  snprintf(path, sizeof path, "%s/room.cfg", test_folder(folder));
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(room, file);
  fclose(file);
  assert_ok(clt_scene_open(path, &scene, &error), error);
  unlink(path);
  rmdir(folder);
  return scene;
}

static stage *stage_open(const clt_frames_options *options) {
  clt_error error = {0};
  stage *made = calloc(1, sizeof *made);
  made->scene = open_room();
  made->transport = clt_scene_transport(made->scene);
  assert_ok(clt_certify(made->transport, &made->certificate, &error), error);
  assert_ok(clt_frames_create(made->transport, made->certificate, options, &made->frames, &error), error);
  return made;
}

static void stage_close(stage *self) {
  clt_frames_destroy(self->frames);
  clt_certificate_destroy(self->certificate);
  clt_scene_close(self->scene);
  free(self);
}

/* A bright disc over a ground that fades; another scene every SCENE frames. */
static void draw(int frame, uint64_t seed, uint8_t *content) {
  uint64_t random = seed + (uint64_t)(frame / SCENE) * 7919;
  double ground[3], disc[3], at = frame % SCENE / (double)SCENE, y0 = 0.3 + 0.4 * test_random(&random);
  for (int c = 0; c < 3; c++) {
    ground[c] = 60 + 90 * test_random(&random);
    disc[c] = 150 + 90 * test_random(&random);
  }
  for (int y = 0; y < CH; y++) {
    for (int x = 0; x < CW; x++) {
      bool inside = hypot(x - at * CW, y - y0 * CH) < CH / 5.0;
      for (int c = 0; c < 3; c++) {
        content[(y * CW + x) * 3 + c] = (uint8_t)(inside ? disc[c] : ground[c] * (0.6 + 0.4 * cos(6.28 * at)));
      }
    }
  }
}

static clt_frames_result run(stage *self, double seconds) {
  clt_error error = {0};
  clt_frames_result result;
  assert_ok(clt_frames_next(self->frames, self->content, CW, CH, seconds, self->gain, self->offset, &result, &error),
            error);
  return result;
}

static double linear(uint8_t code) {
  double v = code / 255.0;
  return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

/* target[c * N + i] = white (scale mean + offset), of cells that are 4 x 4 pixels. */
static void wanted(const stage *self, const clt_frames_result *result, double *target) {
  for (int i = 0; i < C * N; i++) {
    int c = i / N, x = i % N % W, y = i % N / W;
    double sum = 0;
    for (int k = 0; k < 16; k++) {
      sum += linear(self->content[((y * 4 + k / 4) * CW + x * 4 + k % 4) * 3 + c]);
    }
    target[i] = clt_certificate_channel(self->certificate, c)->white * (result->scale * sum / 16 + result->offset);
  }
}

static clt_live_picture picture_of(const stage *self) {
  return (clt_live_picture){.width = CW,
                            .height = CH,
                            .content = self->content,
                            .grid_width = W,
                            .grid_height = H,
                            .gain = self->gain,
                            .offset = self->offset,
                            .panel = clt_panel_of_curve(&(clt_curve){.kind = CLT_CURVE_SRGB}),
                            .seed = 3};
}

/* ||y - target|| / ||target|| with y the scene's own light under the codes that the fields give. */
static double shown_error(const stage *self, const double *target) {
  clt_live_picture picture = picture_of(self);
  clt_image codes = {0}, drive = {0}, seen = {0};
  clt_error error = {0};
  assert_ok(clt_image_init(&codes, C, H, W, &error), error);
  assert_ok(clt_live_encode(&picture, C, H, W, codes.data, &error), error);
  assert_ok(clt_panel_decode(&picture.panel, &codes, &drive, &error), error);
  assert_ok(clt_scene_appearance(self->scene, &drive, &seen, &error), error);
  double off = 0, all = 0;
  for (int i = 0; i < C * N; i++) {
    off += pow((double)seen.data[i] - target[i], 2);
    all += target[i] * target[i];
  }
  clt_image_finish(&codes);
  clt_image_finish(&drive);
  clt_image_finish(&seen);
  return sqrt(off / all);
}

/* The least error that a drive in 0..1 reaches. */
static double best_error(const stage *self, const double *target) {
  double need[C * N], x[C * N], y[N], off = 0, all = 0;
  clt_solve_options options = {.method = "bounded", .tolerance = 1e-7};
  clt_solve_result result;
  clt_error error = {0};
  for (int i = 0; i < C * N; i++) {
    need[i] = target[i] - clt_transport_black(self->transport, i / N)[i % N];
  }
  assert_ok(clt_solve(self->transport, self->certificate, need, &options, x, &result, &error), error);
  for (int c = 0; c < C; c++) {
    clt_transport_apply(self->transport, c, x + c * N, y);
    for (int i = 0; i < N; i++) {
      off += pow(y[i] - need[c * N + i], 2);
      all += target[c * N + i] * target[c * N + i];
    }
  }
  return sqrt(off / all);
}

/* Through cuts and fades each frame appears as near to its target as a drive can, but for the error that was asked for.
 */
static void frames_appear_as_wanted(void **state) {
  (void)state;
  const double asked = 0.004;
  for (uint64_t seed = 1; seed <= 2; seed++) {
    for (int reach = 0; reach < 2; reach++) {
      stage *self = stage_open(&(clt_frames_options){.live = {.target_error = asked}, .reach = reach});
      double target[C * N], worst = 0, least = 1;
      for (int frame = 0; frame < 4 * SCENE; frame++) {
        draw(frame, seed, self->content);
        clt_frames_result result = run(self, 1.0 / 30);
        if (frame % 5 != 0) {
          continue;
        }
        wanted(self, &result, target);
        double error = shown_error(self, target), best = best_error(self, target);
        assert_true(error * error <= best * best + 4 * asked * asked);
        assert_true(result.scale > 0 && result.scale <= 1 && result.offset >= 0);
        worst = fmax(worst, error);
        least = fmin(least, best);
      }
      print_message("seed %d, reach %d: at most %.3f %% off; the least that is possible, of any frame: %.4f %%\n",
                    (int)seed, reach, 100 * worst, 100 * least);
      stage_close(self);
    }
  }
}

/* x = T^-1 wanted, dense, in double. */
static void solve_dense(const stage *self, int c, const double *need, double *x) {
  static double matrix[N * N];
  double unit[N] = {0}, column[N];
  lapack_int pivots[N];
  for (int j = 0; j < N; j++) {
    unit[j] = 1;
    clt_transport_apply(self->transport, c, unit, column);
    unit[j] = 0;
    memcpy(matrix + j * N, column, sizeof column);
  }
  memcpy(x, need, N * sizeof *x);
  assert_int_equal(LAPACKE_dgesv(LAPACK_COL_MAJOR, N, 1, matrix, N, pivots, x, N), 0);
}

/* The least offset c and the largest scale s with 0 <= s (p + c w) - b <= 1, by p, w, b of dense solves. */
static void least_offset(const stage *self, double *scale, double *offset) {
  const clt_frames_result plain = {.scale = 1};
  double target[C * N], p[C * N], w[C * N], b[C * N], need[N];
  wanted(self, &plain, target);
  for (int c = 0; c < C; c++) {
    solve_dense(self, c, target + c * N, p + c * N);
    for (int i = 0; i < N; i++) {
      need[i] = clt_transport_black(self->transport, c)[i];
    }
    solve_dense(self, c, need, b + c * N);
    for (int i = 0; i < N; i++) {
      need[i] = clt_certificate_channel(self->certificate, c)->white;
    }
    solve_dense(self, c, need, w + c * N);
  }
  *scale = 1;
  for (int round = 0; round < 50; round++) {
    double lift = 0, most = 1;
    for (int i = 0; i < C * N; i++) {
      lift = fmax(lift, (b[i] / *scale - p[i]) / w[i]);
    }
    for (int i = 0; i < C * N; i++) {
      most = fmin(most, (1 + b[i]) / (p[i] + lift * w[i]));
    }
    *scale = most;
    *offset = most * lift;
  }
}

/* A picture that stands still comes in reach of the projector by the least offset and the largest scale, smoothly. */
static void what_is_out_of_reach_is_scaled_into_it(void **state) {
  (void)state;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    stage *self = stage_open(&(clt_frames_options){.live = {.target_error = 0.001}, .reach = true});
    draw(SCENE / 2, 40 + seed, self->content);
    clt_frames_result result = {0};
    double before = 1, largest = 0, scale, offset, target[C * N];
    int frames = 0;
    for (; frames < 1000 && !result.settled; frames++) {
      result = run(self, 1.0 / 60);
      largest = fmax(largest, fabs(result.scale - before));
      before = result.scale;
    }
    least_offset(self, &scale, &offset);
    print_message("scale %.4f (wanted %.4f), offset %.4f (%.4f), after %d frames, by at most %.4f at once\n",
                  result.scale, scale, result.offset, offset, frames, largest);
    assert_true(result.settled && (offset > 0.002 || scale < 0.99)); /* it was out of reach */
    assert_near(result.scale, scale, 2e-3);
    assert_near(result.offset, offset, 2e-3);
    wanted(self, &result, target);
    assert_true(shown_error(self, target) < 0.002);
    /* Eight times the usual rate, after a cut: 1 - exp(-8 / 30) = 0.23 of a way that the first steps overestimate. */
    assert_true(largest <= fmax(0.5 * (1 - scale), 1e-3));
    stage_close(self);
  }
}

/* Where the content stands still the fields settle, and then stay as they are to the last bit; on the way there a
 * cell's drive moves little from frame to frame. */
static void nothing_flickers(void **state) {
  (void)state;
  for (int reach = 0; reach < 2; reach++) {
    stage *self = stage_open(&(clt_frames_options){.live = {.target_error = 0.002}, .reach = reach});
    for (int frame = 0; frame < SCENE; frame++) {
      draw(frame, 5, self->content);
      run(self, 1.0 / 60);
    }
    static float gain[C * N], offset[C * N], drive[C * N];
    clt_frames_result result = {0};
    double moved = 0;
    memcpy(drive, clt_frames_drive(self->frames), sizeof drive);
    for (int frame = 0; frame < 1000 && !result.settled; frame++) {
      result = run(self, 1.0 / 60);
      for (int i = 0; i < C * N; i++) {
        moved = fmax(moved, fabs((double)clt_frames_drive(self->frames)[i] - (double)drive[i]));
      }
      memcpy(drive, clt_frames_drive(self->frames), sizeof drive);
    }
    assert_true(result.settled);
    print_message("reach %d: a drive moves by at most %.4f a frame\n", reach, moved);
    assert_true(moved < 0.03);
    memcpy(gain, self->gain, sizeof gain);
    memcpy(offset, self->offset, sizeof offset);
    for (int frame = 0; frame < 20; frame++) {
      run(self, 1.0 / 60);
      assert_memory_equal(self->gain, gain, sizeof gain);
      assert_memory_equal(self->offset, offset, sizeof offset);
    }
    stage_close(self);
  }
}

/* Where no step fits the budget the picture goes on, by its direct light: from nothing it is the picture as it would be
 * without compensation, never a dark one. */
static void without_time_the_picture_goes_on(void **state) {
  (void)state;
  stage *self = stage_open(&(clt_frames_options){.live = {.target_error = 1e-5, .budget_ms = 1e-6}});
  double target[C * N];
  int direct = 0;
  for (int frame = 0; frame < 2 * SCENE; frame++) {
    draw(frame, 3, self->content);
    clt_frames_result result = run(self, 1.0 / 60);
    direct += result.direct;
    wanted(self, &result, target);
    double off = 0, all = 0;
    for (int i = 0; i < C * N; i++) {
      double f = clt_certificate_first_bounce(self->certificate, i / N)[i % N];
      off += pow((double)clt_frames_drive(self->frames)[i] - fmin(target[i] / f, 1), 2);
      all += pow(fmin(target[i] / f, 1), 2);
    }
    assert_true(!result.direct || direct <= frame || off < 1e-8 * all);
    assert_true(shown_error(self, target) < 0.5);
  }
  print_message("%d of %d frames without a step\n", direct, 2 * SCENE);
  stage_close(self);
}

static void memory_is_constant(void **state) {
  (void)state;
  stage *self = stage_open(&(clt_frames_options){.live = {.target_error = 0.02, .budget_ms = 5}, .reach = true});
  size_t used = 0;
  for (int frame = 0; frame < 2000; frame++) {
    draw(frame, 9, self->content);
    run(self, 1.0 / 60);
    used = frame == 20 ? mallinfo2().uordblks : used;
  }
  assert_true(mallinfo2().uordblks <= used + 4096);
  stage_close(self);
}

static clt_frame photograph(clt_scene *scene, clt_camera **camera) {
  clt_error error = {0};
  clt_frame frame;
  assert_ok(clt_scene_open_camera(scene, camera, &error), error);
  assert_ok((*camera)->driver->next(*camera, 500000000, 10, &frame, &error), error);
  return frame;
}

/* The simulated projector shows what the encoder and the dither give. */
static void the_simulated_projector_encodes_by_itself(void **state) {
  (void)state;
  stage *self = stage_open(&(clt_frames_options){.reach = false});
  draw(3, 1, self->content);
  run(self, 1.0 / 60);
  clt_live_picture picture = picture_of(self);
  clt_scene *scenes[2] = {open_room(), open_room()};
  clt_projector *projectors[2] = {NULL};
  clt_camera *cameras[2] = {NULL};
  clt_frame frames[2];
  clt_error error = {0};
  int64_t shown_ns;
  float codes[C * N];
  assert_ok(clt_live_encode(&picture, C, H, W, codes, &error), error);
  clt_live_dither(codes, C * N, 12, picture.seed);
  for (int k = 0; k < 2; k++) {
    assert_ok(clt_scene_open_projector(scenes[k], &projectors[k], &error), error);
    const clt_projector_driver *driver = projectors[k]->driver;
    assert_ok(k == 0 ? driver->present_live(projectors[k], &picture, &shown_ns, &error)
                     : driver->present(projectors[k], codes, &shown_ns, &error),
              error);
    frames[k] = photograph(scenes[k], &cameras[k]);
  }
  size_t samples = (size_t)(frames[0].width * frames[0].height * frames[0].channels);
  assert_memory_equal(frames[0].samples, frames[1].samples, samples * sizeof *frames[0].samples);
  for (int k = 0; k < 2; k++) {
    cameras[k]->driver->close(cameras[k]);
    projectors[k]->driver->close(projectors[k]);
    clt_scene_close(scenes[k]);
  }
  stage_close(self);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(frames_appear_as_wanted), cmocka_unit_test(what_is_out_of_reach_is_scaled_into_it),
      cmocka_unit_test(nothing_flickers),        cmocka_unit_test(without_time_the_picture_goes_on),
      cmocka_unit_test(memory_is_constant),      cmocka_unit_test(the_simulated_projector_encodes_by_itself),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
