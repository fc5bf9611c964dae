/* Moving pictures over a hierarchy: Newton steps on the far light (live_far.h) until the drive is as near to the best
 * as is asked for. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "solve/live_far.h"

enum { STEPS_MAX = 40, STALE_STEPS = 5, ITEMS_AT_ONCE = 8 };
static const double WORSE = 1.001; /* of the least objective: above it a step has gone too far */
static const double MOVED = 0.01; /* of the lit cells: held otherwise than in the factor, from which it is taken anew */
static const double SLOW = 0.3;   /* of the gap before: what a step leaves with a factor that has aged */

/* A frame under way. */
typedef struct frame {
  double size, wanted;                /* ||target|| as errors are told by, and ||target - black||^2 over lit cells */
  double objective, least, gap, seen; /* squares: of the residual, the least so far, the gap, and what is seen */
  double last_s;                      /* that the last step took */
  int stale;                          /* steps since the least */
  bool renew;                         /* the factors have aged */
  bool cold;                          /* begun from a drive of 0 */
  long held;
} frame;

static size_t values_of(const clt_live *live) {
  return (size_t)live->info.channels * live->info.cols;
}

static clt_status reserve(clt_live *live, clt_far *far, clt_error *error) {
  enum { PLANES = 6 };
  const size_t values = values_of(live);
  const size_t margin = (size_t)far->width + 1, drive = values + 2 * margin;
  far->plane = clt_alloc((PLANES - 3) * values + 3 * drive, sizeof *far->plane);
  far->held = clt_alloc(values, 2);
  far->item = clt_alloc(far->items, sizeof *far->item);
  if (far->plane == NULL || far->held == NULL || far->item == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", far->cells);
  }
  far->factored = far->held + values;
  far->wanted = far->plane;
  far->residual = far->plane + values;
  far->inverse = far->plane + 2 * values;
  for (size_t k = 0; k < 3; k++) {
    far->drive[k] = far->plane + 3 * values + k * drive + margin;
  }
  return clt_newton_reserve(far, live->info.channels, error);
}

static void measure_turnover(const clt_far *far, clt_live_item *item) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  for (int32_t k = 0; k < leaf.width * leaf.height; k++) {
    const size_t at = (size_t)item->channel * far->cells + (size_t)(leaf.y + k / leaf.width) * (size_t)far->width +
                      (size_t)(leaf.x + k % leaf.width);
    const float ratio = far->hierarchy->gather[at] * far->inverse[at];
    item->turnover += ratio * ratio;
  }
}

/* 1 / D at lit cells; where the near light of a cell is less than half of what it shows of itself, half of that. */
static clt_status invert_cells(const clt_live *live, clt_far *far, clt_error *error) {
  double *diagonal = clt_alloc(far->cells, sizeof *diagonal);
  if (diagonal == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for the light of %zu cells", far->cells);
  }
  for (int c = 0; c < live->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(live->certificate, c);
    clt_transport_diagonal(live->transport, c, diagonal);
    for (size_t i = 0; i < far->cells; i++) {
      const size_t at = (size_t)c * far->cells + i;
      const double light = fmax((double)far->hierarchy->own[at], diagonal[i] / 2);
      far->inverse[at] = lit[i] && light > 0 ? (float)(1 / light) : 0;
      far->lit[c] += far->inverse[at] > 0;
    }
  }
  free(diagonal);
  for (size_t k = 0; k < far->items; k++) {
    measure_turnover(far, &far->item[k]);
  }
  return CLT_OK;
}

static clt_status create(clt_live *live, clt_error *error) {
  clt_far *far = live->own = clt_alloc(1, sizeof *far);
  if (far == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures");
  }
  const clt_hierarchy_storage *hierarchy = clt_hierarchic_of(live->transport);
  *far = (clt_far){.hierarchy = hierarchy,
                   .kernels = clt_live_choose(),
                   .width = live->info.width,
                   .cells = live->info.cols,
                   .items = hierarchy->leaves * (size_t)live->info.channels,
                   .rank = hierarchy->rank};
  clt_status status = reserve(live, far, error);
  for (size_t k = 0; status == CLT_OK && k < far->items; k++) {
    far->item[k].channel = (int)(k / hierarchy->leaves);
    far->item[k].leaf = k % hierarchy->leaves;
  }
  if (status == CLT_OK) {
    status = clt_live_spread_near(far, (size_t)live->info.channels, error);
  }
  return status == CLT_OK ? invert_cells(live, far, error) : status;
}

static void destroy(clt_live *live) {
  clt_far *far = live->own;
  if (far != NULL) {
    clt_newton_release(far);
    free(far->plane);
    free(far->held);
    free(far->spill);
    free(far->item);
    free(far);
  }
}

static void reset(clt_live *live) {
  clt_far *far = live->own;
  far->now = far->best = 0;
  memset(far->drive[0], 0, values_of(live) * sizeof(float));
  memset(far->q, 0, (size_t)live->info.channels * far->rank * sizeof *far->q);
  memset(far->mean, 0, sizeof far->mean);
  for (size_t k = 0; k < far->items; k++) {
    memset(far->item[k].far, 0, sizeof far->item[k].far);
    memset(far->item[k].pull, 0, sizeof far->item[k].pull);
  }
}

/* Fills what is wanted; returns its square over lit cells. */
static double want(const clt_live *live, clt_far *far, const float *target) {
  double sum = 0;
  for (int c = 0; c < live->info.channels; c++) {
    const float *black = clt_transport_black(live->transport, c), *from = target + (size_t)c * far->cells;
    float *wanted = far->wanted + (size_t)c * far->cells;
    const float *inverse = far->inverse + (size_t)c * far->cells;
    for (size_t i = 0; i < far->cells; i++) {
      wanted[i] = from[i] - black[i];
      sum += inverse[i] > 0 ? (double)wanted[i] * (double)wanted[i] : 0;
    }
  }
  return sum;
}

/* The residual and gap of the drive as it stands. */
static void look(const clt_live *live, clt_far *far, frame *at) {
#pragma omp parallel for schedule(dynamic, ITEMS_AT_ONCE)
  for (size_t k = 0; k < far->items; k++) {
    far->kernels->look(far, &far->item[k]);
  }
  const double before = at->gap;
  at->objective = at->gap = at->seen = 0;
  at->held = 0;
  for (size_t k = 0; k < far->items; k++) {
    at->objective += far->item[k].residual;
    at->gap += far->item[k].gap;
    at->seen += far->item[k].seen;
    at->held += far->item[k].held_cells;
  }
  double drift[CLT_CHANNELS_MAX] = {0}, drifts = 0;
#pragma omp parallel for schedule(dynamic, 1)
  for (int c = 0; c < live->info.channels; c++) {
    drift[c] = clt_newton_drift(far, c);
  }
  for (int c = 0; c < live->info.channels; c++) {
    drifts += drift[c];
  }
  at->gap += drifts + 2 * sqrt(at->gap * drifts);
  at->renew = before > 0 && at->gap > SLOW * SLOW * before;
  at->stale = at->objective < at->least ? 0 : at->stale + 1;
  if (at->objective < at->least) {
    at->least = at->objective;
    far->best = far->now;
  }
}

/* Takes the factor of a channel anew where other cells are held than it knows of. */
static bool keep_factor(clt_far *far, int channel, bool renew) {
  const size_t leaves = far->hierarchy->leaves, first = (size_t)channel * leaves;
  long changed = 0;
  for (size_t k = first; k < first + leaves; k++) {
    changed += far->item[k].changed;
  }
  if (far->ready[channel] && (changed == 0 || (!renew && (double)changed <= MOVED * (double)far->lit[channel]))) {
    return true;
  }
#pragma omp parallel for schedule(dynamic, ITEMS_AT_ONCE)
  for (size_t k = first; k < first + leaves; k++) {
    far->kernels->weigh(far, &far->item[k]);
  }
  const size_t at = (size_t)channel * far->cells;
  memcpy(far->factored + at, far->held + at, far->cells);
  far->ready[channel] = clt_newton_factor(far, channel);
  return far->ready[channel];
}

/* What the drive gives over an item, as `move` leaves it. */
static void give(const clt_far *far, clt_live_item *item) {
  const clt_leaf leaf = far->hierarchy->leaf[item->leaf];
  double given[CLT_LEAF_TERMS] = {0};
  item->light = 0;
  for (int32_t k = 0; k < leaf.width * leaf.height; k++) {
    const double u = clt_leaf_place(k % leaf.width, leaf.width), v = clt_leaf_place(k / leaf.width, leaf.height);
    const size_t at = (size_t)item->channel * far->cells + (size_t)(leaf.y + k / leaf.width) * (size_t)far->width +
                      (size_t)(leaf.x + k % leaf.width);
    const double x = (double)far->drive[far->now][at], value = (double)far->hierarchy->gather[at] * x;
    given[0] += value;
    given[1] += u * value;
    given[2] += v * value;
    given[3] += u * v * value;
    item->light += x;
  }
  for (int t = 0; t < CLT_LEAF_TERMS; t++) {
    item->given[t] = (float)given[t];
  }
}

/* After the drive was changed otherwise than by a step. */
static void give_again(const clt_live *live, clt_far *far) {
#pragma omp parallel for schedule(dynamic, ITEMS_AT_ONCE)
  for (size_t k = 0; k < far->items; k++) {
    give(far, &far->item[k]);
  }
  for (int c = 0; c < live->info.channels; c++) {
    clt_newton_gather(far, c);
  }
}

/* Back half of the way to the best drive: the objective is convex, and both ends lie within the bounds. */
static void halve(const clt_live *live, clt_far *far) {
  const float *best = far->drive[far->best];
  float *x = far->drive[far->now];
  for (size_t at = 0; at < values_of(live); at++) {
    x[at] = 0.5f * (x[at] + best[at]);
  }
  give_again(live, far);
}

/* One Newton step of every channel, into the drive that is neither the last nor the best. */
static bool step(const clt_live *live, clt_far *far, bool renew) {
  const int channels = live->info.channels, next = far->now != 0 && far->best != 0   ? 0
                                                   : far->now != 1 && far->best != 1 ? 1
                                                                                     : 2;
  for (int c = 0; c < channels; c++) {
    if (!keep_factor(far, c, renew)) {
      return false;
    }
  }
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (int c = 0; c < channels; c++) {
      clt_newton_step(far, c);
    }
#pragma omp for schedule(dynamic, ITEMS_AT_ONCE)
    for (size_t k = 0; k < far->items; k++) {
      far->kernels->move(far, &far->item[k], far->drive[next]);
    }
#pragma omp for schedule(dynamic, 1)
    for (int c = 0; c < channels; c++) {
      clt_newton_gather(far, c);
    }
  }
  far->now = next;
  return true;
}

/* Whether another step fits the budget, as the last one took. */
static bool may_go_on(const clt_live *live, const frame *at, int steps) {
  const double spent = clt_clock_since(live->start_ns) + at->last_s, budget = 1e-3 * live->options.budget_ms;
  return steps < STEPS_MAX && at->stale < STALE_STEPS && !(budget > 0 && spent > budget);
}

static void timed_look(const clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  const int64_t since_ns = clt_clock_ns();
  look(live, far, at);
  result->ms[CLT_LIVE_ESTIMATE] += 1e3 * clt_clock_since(since_ns);
}

/* From a drive of 0, at which ||b|| is left. There the bounds say little of which cells they will hold. */
static void start_cold(clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  reset(live);
  at->cold = true;
  at->gap = 0;
  at->least = INFINITY;
  far->open = true;
  timed_look(live, far, at, result);
  far->open = false;
}

/* Steps until the gap is closed; the residual of the drive that is kept is known then. A start that is worse than none,
 * and one from which steps cease to gain, is given up for a cold one. */
static void run(clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  const double wanted = live->options.target_error * at->size;
  timed_look(live, far, at, result);
  if (at->objective >= at->wanted && at->gap > wanted * wanted) {
    start_cold(live, far, at, result);
  }
  while (!(result->converged = sqrt(at->gap) <= wanted)) {
    if (at->stale >= STALE_STEPS && !at->cold) {
      start_cold(live, far, at, result);
    }
    const int64_t since_ns = clt_clock_ns();
    if (!may_go_on(live, at, result->steps)) {
      break;
    }
    if (at->objective > WORSE * at->least) {
      halve(live, far);
    } else if (!step(live, far, at->renew)) {
      break;
    }
    result->steps++;
    result->ms[CLT_LIVE_SOLVE] += 1e3 * clt_clock_since(since_ns);
    timed_look(live, far, at, result);
    at->last_s = clt_clock_since(since_ns);
  }
}

/* After steps that ceased to gain. */
static void return_to_best(const clt_live *live, clt_far *far) {
  far->now = far->best;
  give_again(live, far);
}

static clt_status solve_frame(clt_live *live, const float *target, float *drive, clt_live_result *result,
                              clt_error *error) {
  (void)error;
  clt_far *far = live->own;
  frame at = {.size = clt_live_size(live, target), .least = INFINITY};
  at.wanted = want(live, far, target);
  result->ms[CLT_LIVE_PREPARE] = 1e3 * clt_clock_since(live->start_ns);
  run(live, far, &at, result);
  if (!result->converged && far->now != far->best) {
    return_to_best(live, far);
    at.objective = at.least;
  }
  memcpy(drive, far->drive[far->now], values_of(live) * sizeof *drive);
  size_t lit = 0;
  for (int c = 0; c < live->info.channels; c++) {
    lit += far->lit[c];
  }
  result->residual = sqrt(at.objective) / at.size;
  result->clipped_fraction = lit > 0 ? (double)at.held / (double)lit : 0;
  live->seen = sqrt(at.seen) / at.size;
  return CLT_OK;
}

const clt_live_form clt_live_hierarchic = {create, destroy, reset, solve_frame};
