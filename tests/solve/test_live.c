/* Moving pictures: every frame's drive against the bounded optimum that "bounded" finds to many digits, with residuals
 * computed from the entries of T in double. */
#include <stdbool.h>

#include "../transport/smooth.h"
#include "base/memory.h"
#include "counterlight/live.h"
#include "solve/live_far.h"

enum { SIDE_X = 40, SIDE_Y = 28, CELLS = SIDE_X * SIDE_Y, CHANNELS = 3, VALUES = CHANNELS * CELLS };

typedef struct bench {
  smooth_room room;
  clt_certificate *certificate;
  clt_live *live;
} bench;

/* Rooms whose far light is `far` of their near light: from .5 (Jacobi converges) to 4. */
static bench set_up(double far, double target_error, uint64_t seed) {
  const size_case size = {SIDE_X, SIDE_Y, CHANNELS, CELLS};
  uint64_t state = seed;
  clt_error error = {0};
  bench made = {.room = make_smooth_room(&size, far, 0, false, &state)};
  float *black = clt_transport_black(made.room.blocks, 1);
  for (size_t i = 0; i < CELLS; i++) {
    black[i] = 0.01f;
  }
  clt_transport_provenance(made.room.blocks)->error = 0.001;
  assert_ok(clt_certify(made.room.blocks, &made.certificate, &error), error);
  const clt_live_options options = {.target_error = target_error};
  assert_ok(clt_live_create(made.room.blocks, made.certificate, &options, &made.live, &error), error);
  return made;
}

static void tear_down(bench *used) {
  clt_live_destroy(used->live);
  clt_certificate_destroy(used->certificate);
  finish_smooth_room(&used->room);
}

static double *seen_under(const bench *used, const float *drive) {
  double *seen = calloc(VALUES, sizeof *seen);
  for (size_t at = 0; at < VALUES; at++) {
    const double *row = used->room.entries + at * CELLS;
    seen[at] = (double)clt_transport_black(used->room.blocks, (int)(at / CELLS))[at % CELLS];
    for (size_t j = 0; j < CELLS; j++) {
      seen[at] += row[j] * (double)drive[at / CELLS * CELLS + j];
    }
  }
  return seen;
}

/* ||y - target|| / ||target||; of black targets relative to white, the median of the diagonal. */
static double appearance_error(const bench *used, const float *drive, const float *target) {
  double *seen = seen_under(used, drive), apart = 0, size = 0, white = 0;
  for (size_t at = 0; at < VALUES; at++) {
    const double level = clt_certificate_channel(used->certificate, (int)(at / CELLS))->white;
    apart += (seen[at] - (double)target[at]) * (seen[at] - (double)target[at]);
    size += (double)target[at] * (double)target[at];
    white += level * level;
  }
  free(seen);
  return sqrt(apart / (size > 0 ? size : white));
}

/* The same of the best drive in 0..1. */
static double best_error(const bench *used, const float *target) {
  double *wanted = calloc(2 * VALUES, sizeof *wanted), *drive = wanted + VALUES;
  float *brief = calloc(VALUES, sizeof *brief);
  const clt_solve_options options = {.method = "bounded", .tolerance = 1e-8, .iteration_limit = 4000};
  clt_solve_result result;
  clt_error error = {0};
  for (size_t at = 0; at < VALUES; at++) {
    wanted[at] = (double)target[at] - (double)clt_transport_black(used->room.blocks, (int)(at / CELLS))[at % CELLS];
  }
  assert_ok(clt_solve(used->room.blocks, used->certificate, wanted, &options, drive, &result, &error), error);
  for (size_t at = 0; at < VALUES; at++) {
    brief[at] = (float)drive[at];
  }
  const double found = appearance_error(used, brief, target);
  free(wanted);
  free(brief);
  return found;
}

typedef enum picture { REACHABLE, HALF, CHECKER, SINGLE, BLACK, DIM, PICTURES } picture;

static void draw(const bench *used, picture what, uint64_t seed, float *target) {
  uint64_t state = seed;
  float *drive = calloc(VALUES, sizeof *drive);
  for (size_t at = 0; at < VALUES; at++) {
    drive[at] = (float)(0.1 + 0.8 * test_random(&state));
  }
  double *seen = seen_under(used, drive);
  for (size_t at = 0; at < VALUES; at++) {
    const size_t x = at % SIDE_X, y = at % CELLS / SIDE_X;
    const double plain[PICTURES] = {
        seen[at], x < SIDE_X / 2 ? 1 : 0, (x / 4 + y / 4) % 2 ? 1.2 : 0, x == 11 && y == 9 ? 1 : 0, 0, 0.05};
    target[at] = (float)plain[what];
  }
  free(seen);
  free(drive);
}

static void solve(const bench *used, const float *target, float *drive, clt_live_result *result) {
  clt_error error = {0};
  assert_ok(clt_live_solve(used->live, target, drive, result, &error), error);
  for (size_t at = 0; at < VALUES; at++) {
    assert_true(drive[at] >= 0 && drive[at] <= 1);
  }
}

/* In every room every target comes within target_error of the best that any drive in 0..1 reaches, the residual that is
 * told is the one that the entries give, and the estimate is no less. */
static void test_targets(void **unused) {
  (void)unused;
  static const double FAR[] = {0.5, 1.5, 4};
  float *target = calloc(2 * VALUES, sizeof *target), *drive = target + VALUES;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    bench used = set_up(FAR[seed - 1], 1e-3, seed);
    for (picture what = REACHABLE; what < PICTURES; what++) {
      clt_live_result result;
      draw(&used, what, seed, target);
      clt_live_reset(used.live);
      solve(&used, target, drive, &result);
      const double error = appearance_error(&used, drive, target), best = best_error(&used, target);
      assert_true(result.converged);
      assert_near(result.residual, error, 1e-5 + 1e-4 * error);
      assert_true(result.error >= result.residual && error <= 1.2 * result.error);
      assert_true(error <= best + 1e-3);
      assert_true(what != REACHABLE || error <= 1e-3);
      assert_true(result.total_ms >= result.ms[CLT_LIVE_SOLVE]);
    }
    tear_down(&used);
  }
  free(target);
}

/* A target that comes again changes nothing; one that changes by 3 % takes two steps, by 1 % one, which
 * is fewer than from nothing. */
static void test_warm(void **unused) {
  (void)unused;
  float *target = calloc(3 * VALUES, sizeof *target), *drive = target + VALUES, *again = target + 2 * VALUES;
  bench used = set_up(1.5, 1e-4, 7);
  clt_live_result cold, result;
  for (picture what = REACHABLE; what < PICTURES; what++) {
    draw(&used, what, 7, target);
    solve(&used, target, drive, &result);
    solve(&used, target, again, &result);
    assert_int_equal(result.steps, 0);
    assert_memory_equal(drive, again, VALUES * sizeof *drive);
  }
  const float changes[] = {0.03f, 0.01f};
  for (int k = 0; k < 2; k++) {
    draw(&used, REACHABLE, 8, target);
    clt_live_reset(used.live);
    solve(&used, target, drive, &cold);
    for (size_t at = 0; at < VALUES; at++) {
      target[at] *= 1 - changes[k] * (float)(at % SIDE_X) / SIDE_X;
    }
    solve(&used, target, drive, &result);
    assert_true(result.converged && result.steps <= 2 - k && result.steps <= cold.steps - k);
    assert_true(appearance_error(&used, drive, target) <= 1e-4);
  }
  free(target);
  tear_down(&used);
}

/* A cut from frame to frame ends as a start from nothing does (NUMERICS 8, case 26). */
static void test_cuts(void **unused) {
  (void)unused;
  float *target = calloc(2 * VALUES, sizeof *target), *drive = target + VALUES;
  bench used = set_up(1.5, 1e-3, 9);
  clt_live_result result;
  for (int cut = 0; cut < 24; cut++) {
    const picture what = (picture)(cut * 5 % PICTURES);
    draw(&used, what, (uint64_t)cut, target);
    solve(&used, target, drive, &result);
    assert_true(result.converged);
    assert_true(appearance_error(&used, drive, target) <= best_error(&used, target) + 1e-3);
  }
  free(target);
  tear_down(&used);
}

/* A budget that is over at once leaves a drive whose residual is told, and the next frames go on from it. */
static void test_budget(void **unused) {
  (void)unused;
  float *target = calloc(2 * VALUES, sizeof *target), *drive = target + VALUES;
  bench used = set_up(1.5, 1e-5, 11);
  clt_live_result result;
  draw(&used, HALF, 11, target);
  clt_live_set_budget(used.live, 1e-6);
  solve(&used, target, drive, &result);
  assert_false(result.converged);
  assert_near(result.residual, appearance_error(&used, drive, target), 1e-4);
  clt_live_set_budget(used.live, 0);
  solve(&used, target, drive, &result);
  assert_true(result.converged);
  free(target);
  tear_down(&used);
}

/* The cell of a lane of an item's number'th strip of a row; CELLS behind the edge of its leaf. */
static size_t cell_of(const clt_far *far, const clt_live_item *item, size_t number, size_t lane) {
  const clt_leaf *leaf = &far->hierarchy->leaf[item->leaf];
  const clt_live_spot spot = clt_live_spot_of(leaf, (int32_t)number);
  const int32_t across = spot.across + (int32_t)lane;
  return across < leaf->width ? (size_t)((leaf->y + spot.row) * SIDE_X + leaf->x + across) : CELLS;
}

static size_t strips_of(const clt_far *far, const clt_live_item *item) {
  const clt_leaf *leaf = &far->hierarchy->leaf[item->leaf];
  return (size_t)(clt_live_across(leaf) * leaf->height);
}

/* What passes keep of the light that a drive gives, against T as products have it. */
static void test_light(void **unused) {
  (void)unused;
  static const double FAR[] = {0.5, 1.5, 4};
  float *target = calloc(2 * VALUES, sizeof *target), *drive = target + VALUES;
  double *exact = calloc(2 * VALUES, sizeof *exact), *given = exact + VALUES;
  for (uint64_t seed = 1; seed <= 3; seed++) {
    bench used = set_up(FAR[seed - 1], 1e-4, 20 + seed);
    const clt_far *far = used.live->own;
    clt_live_result result;
    double apart = 0, size = 0;
    draw(&used, seed == 2 ? CHECKER : REACHABLE, seed, target);
    solve(&used, target, drive, &result);
    for (size_t at = 0; at < VALUES; at++) {
      given[at] = (double)drive[at];
    }
    clt_transport_apply_all(used.live->transport, given, exact);
    for (size_t k = 0; k < far->items; k++) {
      const clt_live_item *item = &far->item[k];
      for (size_t at = 0; at < strips_of(far, item) * CLT_LIVE_LANES; at++) {
        const size_t cell = cell_of(far, item, at / CLT_LIVE_LANES, at % CLT_LIVE_LANES);
        const double light = cell < CELLS ? exact[(size_t)item->channel * CELLS + cell] : 0;
        const double shown = (double)far->shown[item->first * CLT_LIVE_LANES + at];
        apart += (shown - light) * (shown - light);
        size += light * light;
      }
    }
    assert_true(size > 0 && sqrt(apart / size) < 1e-6);
    print_message("light of a drive by passes: off by %.1e of it\n", sqrt(apart / size));
    tear_down(&used);
  }
  free(target);
  free(exact);
}

/* Where the diagonal of T is taken for what a cell shows of itself, steps are shorter and end at the same drive: here
 * twice the near light everywhere. Where it is the near light, nothing changes. */
static void test_damped(void **unused) {
  (void)unused;
  float *target = calloc(4 * VALUES, sizeof *target);
  clt_live_result result[3];
  for (size_t k = 0; k < 3; k++) {
    bench used = set_up(1.5, 1e-4, 33);
    clt_far *far = used.live->own;
    far->diagonal = k > 0 ? clt_alloc(far->strips, sizeof far->strip->own) : NULL;
    for (size_t at = 0; k > 0 && at < far->strips * CLT_LIVE_LANES; at++) {
      far->diagonal[at] = (float)k * far->strip[at / CLT_LIVE_LANES].own[at % CLT_LIVE_LANES];
    }
    for (size_t at = 0; k > 0 && at < far->items; at++) {
      far->item[at].damped = true;
    }
    draw(&used, k == 2 ? REACHABLE : HALF, 33, target);
    solve(&used, target, target + (k + 1) * VALUES, &result[k]);
    assert_true(result[k].converged && (k != 2 || appearance_error(&used, target + 3 * VALUES, target) < 1e-4));
    tear_down(&used);
  }
  assert_memory_equal(target + VALUES, target + 2 * VALUES, VALUES * sizeof *target);
  free(target);
}

/* A cell whose near light is less than half of the diagonal of T is given half of that, in its leaf only. Black that is
 * all but none is none. */
static void test_dim_cells(void **unused) {
  (void)unused;
  enum { DIM_CELL = 3 * SIDE_X + 5 };
  bench used = set_up(1.5, 1e-4, 35);
  clt_transport *dim = NULL;
  clt_live *live = NULL;
  clt_error error = {0};
  double diagonal[CELLS];
  assert_ok(clt_transport_create_hierarchy(used.room.blocks, 5e-3, &dim, &error), error);
  clt_hierarchic_of(dim)->own[CELLS + DIM_CELL] = 0;
  clt_transport_diagonal(dim, 1, diagonal);
  for (size_t i = 0; i < CELLS; i++) {
    clt_transport_black(dim, 2)[i] = 1e-35f;
  }
  assert_ok(clt_live_create(dim, used.certificate, NULL, &live, &error), error);
  const clt_far *far = live->own;
  size_t damped = 0;
  for (size_t k = 0; k < far->items; k++) {
    const clt_live_item *item = &far->item[k];
    damped += item->damped;
    assert_true((item->unit[CLT_LIVE_BLACK] > 0) == (item->channel == 1));
    for (size_t at = 0; item->damped && at < strips_of(far, item) * CLT_LIVE_LANES; at++) {
      const size_t cell = cell_of(far, item, at / CLT_LIVE_LANES, at % CLT_LIVE_LANES);
      const double own = cell < CELLS ? (double)far->hierarchy->own[CELLS + cell] : 0;
      const float found = far->diagonal[item->first * CLT_LIVE_LANES + at];
      assert_near((double)found, cell == DIM_CELL ? diagonal[cell] / 2 : own, 1e-7);
      assert_true(item->channel == 1 && (found > 0) == (cell < CELLS));
    }
  }
  assert_int_equal(damped, 1);
  clt_live_destroy(live);
  clt_transport_destroy(dim);
  tear_down(&used);
}

/* The drive has the same bits whatever the processor can do. */
static void test_variants(void **unused) {
  (void)unused;
  float *target = calloc(3 * VALUES, sizeof *target);
  for (size_t k = 0; clt_live_variants[k] != NULL; k++) {
    bench used = set_up(1.5, 1e-4, 13);
    clt_live_result result;
    if (clt_live_variants[k]->runs_here()) {
      ((clt_far *)used.live->own)->kernels = clt_live_variants[k];
      draw(&used, HALF, 13, target);
      solve(&used, target, target + (k == 0 ? 1 : 2) * VALUES, &result);
      assert_true(k == 0 || memcmp(target + VALUES, target + 2 * VALUES, VALUES * sizeof *target) == 0);
    }
    tear_down(&used);
  }
  free(target);
}

/* Dense storage of the same room is given leaves: the same drives, as far as these tell. */
static void test_dense(void **unused) {
  (void)unused;
  float *target = calloc(3 * VALUES, sizeof *target), *drive = target + VALUES, *other = target + 2 * VALUES;
  bench used = set_up(1.5, 1e-4, 15);
  clt_transport *dense = NULL;
  clt_live *live = NULL;
  clt_error error = {0};
  clt_live_result result;
  const clt_live_options options = {.target_error = 1e-6};
  assert_ok(clt_transport_convert(used.room.blocks, "dense", &dense, &error), error);
  assert_ok(clt_live_create(dense, used.certificate, &options, &live, &error), error);
  assert_string_equal(clt_transport_describe(live->transport).storage, "hierarchy");
  draw(&used, REACHABLE, 15, target);
  solve(&used, target, drive, &result);
  assert_ok(clt_live_solve(live, target, other, &result, &error), error);
  const double simplified = clt_transport_simplified(live->transport);
  assert_true(result.converged && simplified < 5e-3 && appearance_error(&used, other, target) < 2 * simplified);
  for (size_t at = 0; at < VALUES; at++) {
    assert_near((double)drive[at], (double)other[at], 0.03);
  }
  clt_live_destroy(live);
  clt_transport_destroy(dense);
  tear_down(&used);
  free(target);
}

/* A T whose entries have no order has no leaves, and goes by products. */
static void test_general(void **unused) {
  (void)unused;
  float *target = calloc(2 * VALUES, sizeof *target), *drive = target + VALUES;
  bench used = set_up(0.8, 1e-4, 15);
  clt_transport *dense = NULL;
  clt_certificate *certificate = NULL;
  clt_live *live = NULL;
  clt_error error = {0};
  clt_live_result result;
  const clt_live_options options = {.target_error = 1e-4};
  uint64_t state = 3;
  assert_ok(clt_transport_convert(used.room.blocks, "dense", &dense, &error), error);
  for (size_t k = 0; k < (size_t)VALUES * CELLS; k++) {
    const float more = (float)(1e-3 * test_random(&state));
    clt_transport_entries(dense, (int)(k / CELLS / CELLS))[k % ((size_t)CELLS * CELLS)] += more;
    used.room.entries[k] += (double)more;
  }
  assert_ok(clt_certify(dense, &certificate, &error), error);
  assert_ok(clt_live_create(dense, certificate, &options, &live, &error), error);
  assert_string_equal(clt_transport_describe(live->transport).storage, "dense");
  draw(&used, REACHABLE, 15, target);
  assert_ok(clt_live_solve(live, target, drive, &result, &error), error);
  assert_true(result.converged && result.residual < 1e-4);
  assert_near(result.residual, appearance_error(&used, drive, target), 1e-5);
  clt_live_destroy(live);
  clt_certificate_destroy(certificate);
  clt_transport_destroy(dense);
  tear_down(&used);
  free(target);
}

/* Light between two walls of other colours in every channel, far_ij = a_i a_j g_ij, by many blocks. */
static clt_transport *make_coloured_room(uint64_t *state) {
  enum { ACROSS = 8, DOWN = 4, BLOCKS = ACROSS * DOWN };
  int32_t of[CELLS], cell[CELLS];
  int64_t start[CELLS + 1] = {0};
  float flux[CELLS], *column = calloc((size_t)VALUES * BLOCKS, sizeof *column), value[VALUES];
  for (int i = 0; i < CELLS; i++) {
    of[i] = i % SIDE_X * ACROSS / SIDE_X + ACROSS * (i / SIDE_X * DOWN / SIDE_Y);
    cell[i] = i;
    start[i + 1] = i + 1;
    flux[i] = 1;
  }
  for (int at = 0; at < VALUES; at++) {
    value[at] = (float)(0.8 + 0.4 * test_random(state));
  }
  for (int c = 0; c < CHANNELS; c++) {
    for (int k = 0; k < CELLS * CELLS; k++) {
      const int i = k / CELLS, j = k % CELLS;
      const double x = (i % SIDE_X - j % SIDE_X) / 10.0, y = (i / SIDE_X - j / SIDE_X) / 10.0;
      const double paint[2] = {i % SIDE_X < SIDE_X / 2 ? 1 - 0.3 * c : 0.8,
                               j % SIDE_X < SIDE_X / 2 ? 1 - 0.3 * c : 0.8};
      column[((size_t)c * BLOCKS + (size_t)of[j]) * CELLS + (size_t)i] +=
          (float)(6e-4 * paint[0] * paint[1] / (1 + x * x + y * y));
    }
  }
  const clt_block_parts parts = {BLOCKS, of, flux, column, start, cell, value};
  clt_transport *made = NULL;
  clt_error error = {0};
  assert_ok(clt_transport_create_blocks(SIDE_X, SIDE_Y, CHANNELS, &parts, &made, &error), error);
  free(column);
  return made;
}

/* ||T x - target|| / ||target|| by the products of a transport. */
static double error_by(const clt_transport *transport, const double *drive, const float *target) {
  double seen[CELLS], apart = 0, size = 0;
  for (int c = 0; c < CHANNELS; c++) {
    clt_transport_apply(transport, c, drive + c * CELLS, seen);
    for (int i = 0; i < CELLS; i++) {
      const double wanted = (double)target[c * CELLS + i];
      apart += (seen[i] - wanted) * (seen[i] - wanted);
      size += wanted * wanted;
    }
  }
  return sqrt(apart / size);
}

/* Channels that share their factors, in codes: frames come as near to the best of what is stored as others do, and what
 * is stored differs from T by no more than it says. */
static void test_shared(void **unused) {
  (void)unused;
  uint64_t state = 5;
  clt_error error = {0};
  clt_transport *room = make_coloured_room(&state);
  clt_certificate *certificate = NULL;
  clt_live *live = NULL;
  const clt_live_options options = {.target_error = 1e-3};
  const clt_solve_options exact = {.method = "bounded", .tolerance = 1e-8, .iteration_limit = 4000};
  float *target = calloc(2 * VALUES, sizeof *target), *drive = target + VALUES;
  double *wanted = calloc(3 * VALUES, sizeof *wanted), *best = wanted + VALUES, *mine = best + VALUES;
  assert_ok(clt_certify(room, &certificate, &error), error);
  assert_ok(clt_live_create(room, certificate, &options, &live, &error), error);
  const clt_hierarchy_storage *own = clt_hierarchic_of(live->transport);
  print_message("rank %zu, %d bits, %g left out\n", own->rank, own->left.bits, own->error);
  assert_non_null(own->core);
  assert_true(own->left.sets == 1 && own->left.bits < 32 && own->error < 2e-2);
  for (int step = 0; step < 12; step++) {
    clt_live_result result;
    clt_solve_result solved;
    const double swing = step < 6 ? 0.3 : 1.5;
    for (int at = 0; at < VALUES; at++) {
      const int x = at % SIDE_X, y = at % CELLS / SIDE_X;
      target[at] = (float)(0.6 + 0.4 * swing * sin(0.4 * x + 0.1 * step) * cos(0.3 * y) + 0.05 * (at / CELLS));
      target[at] = fmaxf(target[at], 0);
      wanted[at] = (double)target[at];
    }
    assert_ok(clt_live_solve(live, target, drive, &result, &error), error);
    assert_ok(clt_solve(live->transport, certificate, wanted, &exact, best, &solved, &error), error);
    for (int at = 0; at < VALUES; at++) {
      mine[at] = (double)drive[at];
    }
    const double stored = error_by(live->transport, mine, target), least = error_by(live->transport, best, target);
    assert_true(result.converged);
    assert_near(result.residual, stored, 1e-5 + 1e-4 * stored);
    assert_true(stored <= least + 1e-3);
    assert_near(error_by(room, mine, target), stored, 2 * own->error);
    assert_true(step < 6 ? least < 1e-6 : result.clipped_fraction > 0.05);
  }
  free(target);
  free(wanted);
  clt_live_destroy(live);
  clt_certificate_destroy(certificate);
  clt_transport_destroy(room);
}

static void test_refusals(void **unused) {
  (void)unused;
  bench used = set_up(0.5, 1e-3, 17);
  clt_error error = {0};
  clt_live *live = NULL;
  const clt_live_options bad[] = {
      {.target_error = -1}, {.target_error = 1}, {.target_error = NAN}, {.budget_ms = -1}, {.budget_ms = NAN}};
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
    assert_int_equal(clt_live_create(used.room.blocks, used.certificate, &bad[k], &live, &error), CLT_BAD_INPUT);
    assert_null(live);
  }
  clt_live_destroy(NULL);
  tear_down(&used);
}

/* A target that is not finite is refused, and the frame after it goes on from the drive before. */
static void test_no_target(void **unused) {
  (void)unused;
  float *target = calloc(3 * VALUES, sizeof *target), *drive = target + VALUES, *again = target + 2 * VALUES;
  bench used = set_up(0.5, 1e-3, 19);
  clt_error error = {0};
  clt_live_result result;
  draw(&used, HALF, 19, target);
  solve(&used, target, drive, &result);
  const float bad[] = {NAN, INFINITY, -INFINITY};
  for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
    const float good = target[7 + 900 * k];
    target[7 + 900 * k] = bad[k];
    memcpy(again, drive, VALUES * sizeof *drive);
    assert_int_equal(clt_live_solve(used.live, target, again, &result, &error), CLT_BAD_INPUT);
    assert_memory_equal(drive, again, VALUES * sizeof *drive);
    target[7 + 900 * k] = good;
    solve(&used, target, again, &result);
    assert_true(result.steps == 0 && result.converged);
    assert_memory_equal(drive, again, VALUES * sizeof *drive);
  }
  free(target);
  tear_down(&used);
}

/* Frame `number` of a film: it moves, its second shot asks for more than any drive gives, its third is so dark that it
 * is better begun from nothing, and in each shot one frame is that before it again. */
static void draw_film(const bench *used, int number, float *target) {
  enum { SHOT = 12, AGAIN = 7 };
  const int shot = number / SHOT, at = number % SHOT - (number % SHOT >= AGAIN);
  const double swing = shot == 1 ? 1.5 : 0.3, bright = shot == 2 ? 0.2 : 1.5;
  for (size_t k = 0; k < VALUES; k++) {
    const double x = (double)(k % SIDE_X), y = (double)(k % CELLS / SIDE_X), white = k / CELLS == 1 ? 1 : 0.8;
    const double level = 0.5 + swing * sin(0.3 * x + 0.04 * at + 2 * shot) * cos(0.2 * y - 0.02 * at);
    target[k] =
        (float)(white * fmax(level, 0) * clt_certificate_channel(used->certificate, (int)(k / CELLS))->white * bright);
  }
}

/* Channel after channel frames come to the bits to which they come together, and one that is refused halfway leaves the
 * drive as it was, from where others go on. */
static void test_apart(void **unused) {
  (void)unused;
  enum { FRAMES = 36, REFUSED = 18 };
  float *target = calloc(4 * VALUES, sizeof *target), *drive = target + VALUES, *other = target + 2 * VALUES;
  bench used = set_up(1.5, 1e-3, 23), apart = set_up(1.5, 1e-3, 23);
  clt_far *far = apart.live->own;
  clt_error error = {0};
  clt_live_result result, found;
  int stepped = 0, held = 0;
  far->apart = true;
  for (int number = 0; number < FRAMES; number++) {
    draw_film(&used, number, target);
    if (number == REFUSED) {
      const float good = target[VALUES - 1];
      float *last = target + 3 * VALUES;
      memcpy(last, far->drive[far->now], VALUES * sizeof *last);
      target[VALUES - 1] = NAN;
      assert_int_equal(clt_live_solve(apart.live, target, other, &found, &error), CLT_BAD_INPUT);
      assert_memory_equal(far->drive[far->now], last, VALUES * sizeof *last);
      target[VALUES - 1] = good;
    }
    far->share = number % 2 == 0 ? far->share : 1e9; /* a step is foreseen */
    solve(&used, target, drive, &result);
    solve(&apart, target, other, &found);
    assert_int_equal(found.steps, result.steps);
    assert_near(found.residual, result.residual, 1e-4);
    assert_true(number >= REFUSED || memcmp(drive, other, VALUES * sizeof *drive) == 0);
    stepped += found.steps;
    held += found.clipped_fraction > 0.05;
  }
  assert_true(stepped > FRAMES / 2 && held > FRAMES / 4);
  free(target);
  tear_down(&used);
  tear_down(&apart);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_targets),   cmocka_unit_test(test_warm),     cmocka_unit_test(test_cuts),
      cmocka_unit_test(test_budget),    cmocka_unit_test(test_variants), cmocka_unit_test(test_dense),
      cmocka_unit_test(test_general),   cmocka_unit_test(test_shared),   cmocka_unit_test(test_refusals),
      cmocka_unit_test(test_light),     cmocka_unit_test(test_damped),   cmocka_unit_test(test_dim_cells),
      cmocka_unit_test(test_no_target), cmocka_unit_test(test_apart)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
