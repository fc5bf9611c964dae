/* Moving pictures over a hierarchy: Newton steps on the far light (live_far.h) until the drive is as near to the best
 * as is asked for. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"
#include "solve/live_factor.h"

enum { STEPS_MAX = 40, STALE_STEPS = 5 };
enum { WORTH_SHARING = 16384, WORTH_PARTING = 1 << 22 }; /* values */

static const double WORSE = 1.001; /* of the least objective: above it a step has gone too far */
static const double MOVED = 0.03; /* of the lit cells: held otherwise than in the factor, from which it is taken anew */
static const double SLOW = 0.3;   /* of the gap before: what a step leaves with a factor that has aged */

/* A frame under way. */
typedef struct frame {
  double size, wanted;                /* ||target||^2 and ||target - black||^2 over lit cells */
  double objective, least, gap, seen; /* squares: of the residual, the least so far, the gap, and what is seen */
  double held;                        /* cells */
  double last_s;                      /* that the last step took */
  int stale;                          /* steps since the least */
  bool renew;                         /* the factors have aged */
  bool cold;                          /* begun from a drive of 0 */
} frame;

static size_t values_of(const clt_live *live) {
  return (size_t)live->info.channels * live->info.cols;
}

/* diagonal = D at lit cells, else 0: what a cell shows of itself, or where its near light is less than half of that,
 * half of it. entry is room for a channel. */
static void find_diagonal(const clt_live *live, clt_far *far, double *entry, float *diagonal) {
  for (int c = 0; c < live->info.channels; c++) {
    const unsigned char *lit = clt_certificate_lit(live->certificate, c);
    clt_transport_diagonal(live->transport, c, entry);
    for (size_t i = 0; i < far->cells; i++) {
      const size_t at = (size_t)c * far->cells + i;
      const double light = fmax((double)far->hierarchy->own[at], entry[i] / 2);
      diagonal[at] = lit[i] && light > 0 ? (float)light : 0;
      far->lit[c] += diagonal[at] > 0;
    }
  }
}

static clt_status lay_out(const clt_live *live, clt_far *far, clt_error *error) {
  double *entry = clt_alloc(far->cells, sizeof *entry);
  float *diagonal = clt_alloc(values_of(live), sizeof *diagonal);
  const float *black[CLT_CHANNELS_MAX] = {NULL};
  clt_status status = CLT_OK;
  if (entry == NULL || diagonal == NULL) {
    status = clt_fail(error, CLT_FAILED, "no memory for the light of %zu cells", far->cells);
  } else {
    for (int c = 0; c < far->channels; c++) {
      black[c] = clt_transport_black(live->transport, c);
    }
    find_diagonal(live, far, entry, diagonal);
    status = clt_live_pack(far, diagonal, black, error);
  }
  free(entry);
  free(diagonal);
  return status;
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
                   .channels = live->info.channels,
                   .to = live->info.channels,
                   .cells = live->info.cols,
                   .items = hierarchy->leaves * (size_t)live->info.channels,
                   .rank = hierarchy->rank,
                   .apart = live->info.channels > 1 && values_of(live) >= WORTH_PARTING,
                   .share = live->info.channels,
                   .shared = values_of(live) >= WORTH_SHARING};
  far->item = clt_alloc(far->items, sizeof *far->item);
  if (far->item == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for moving pictures of %zu cells", far->cells);
  }
  for (size_t k = 0; k < far->items; k++) {
    far->item[k].channel = (int)(k / hierarchy->leaves);
    far->item[k].leaf = k % hierarchy->leaves;
  }
  clt_status status = lay_out(live, far, error);
  return status == CLT_OK ? clt_newton_create(far, error) : status;
}

static void destroy(clt_live *live) {
  clt_far *far = live->own;
  if (far != NULL) {
    clt_newton_destroy(far);
    clt_live_unpack(far);
    free(far->item);
    free(far);
  }
}

static void reset(clt_live *live) {
  clt_far *far = live->own;
  far->now = far->best = 0;
  memset(far->drive[0], 0, values_of(live) * sizeof(float));
  memset(far->shown, 0, far->strips * CLT_LIVE_LANES * sizeof(float));
  memset(far->q, 0, (size_t)live->info.channels * far->rank * sizeof *far->q);
  memset(far->mean, 0, sizeof far->mean);
  memset(far->pulled, 0, sizeof far->pulled);
  for (size_t k = 0; k < far->items; k++) {
    memset(far->item[k].far, 0, sizeof far->item[k].far);
    memset(far->item[k].pull, 0, sizeof far->item[k].pull);
    far->item[k].seen = 0;
  }
}

/* Adds what a pass over the cells has found of the drive as it stands. */
static void add_up(const clt_far *far, frame *at) {
  const clt_live_item *item = clt_live_first(far);
  for (size_t k = 0; k < clt_live_count(far); k++) {
    at->objective += item[k].residual;
    at->gap += item[k].gap;
    at->seen += item[k].seen;
    at->wanted += item[k].wanted;
    at->size += item[k].size;
    at->held += (double)item[k].held[0];
  }
}

/* How the drive of every channel stands, found by a pass over each. */
static void take_stock(clt_far *far, frame *at) {
  const double before = at->gap;
  at->objective = at->gap = at->seen = at->wanted = at->size = 0;
  at->held = 0;
  add_up(far, at);
  at->renew = before > 0 && at->gap > SLOW * SLOW * before;
  at->stale = at->objective < at->least ? 0 : at->stale + 1;
  if (at->objective < at->least) {
    at->least = at->objective;
    far->best = far->now;
  }
}

/* The residual and gap of the drive that is known, for the target. */
static void aim(clt_far *far, clt_live_result *result) {
  const int64_t since_ns = clt_clock_ns();
  clt_turns turns = clt_live_turns(far);
#pragma omp parallel if (far->shared)
  for (clt_live_item *item, *end; clt_live_next(far, &turns, &item, &end);) {
    for (; item < end; item++) {
      far->kernels->aim(far, item);
    }
  }
  result->ms[CLT_LIVE_PREPARE] += 1e3 * clt_clock_since(since_ns);
}

/* The same of the drive that was changed. */
static void look(clt_far *far, clt_live_result *result) {
  const int64_t since_ns = clt_clock_ns();
  clt_turns turns = clt_live_turns(far);
#pragma omp parallel if (far->shared)
  {
    clt_newton_gather(far);
    for (clt_live_item *item, *end; clt_live_next(far, &turns, &item, &end);) {
      for (; item < end; item++) {
        clt_newton_light(far, item);
        far->kernels->look(far, item);
      }
    }
  }
  result->ms[CLT_LIVE_ESTIMATE] += 1e3 * clt_clock_since(since_ns);
}

/* Whether the drive is near enough to the best. The gap has two parts: what the cells would do by q, and by how much
 * that changes with q; the second is asked for only where the first is small. */
static bool is_near(clt_far *far, const frame *at, double enough, clt_live_result *result) {
  if (sqrt(at->gap) > enough) {
    return false;
  }
  const int64_t since_ns = clt_clock_ns();
  double drift[CLT_CHANNELS_MAX] = {0}, drifts = 0;
#pragma omp parallel if (far->shared)
  clt_newton_drift(far, drift);
  for (int c = 0; c < far->channels; c++) {
    drifts += drift[c];
  }
  result->ms[CLT_LIVE_ESTIMATE] += 1e3 * clt_clock_since(since_ns);
  return sqrt(at->gap) + sqrt(drifts) <= enough;
}

/* Whether the factor of a channel is to be taken anew, because other cells are held than it knows of: by leaves, for it
 * knows no cells. That of no held cell is always there. */
static bool has_aged(clt_far *far, int channel, bool renew) {
  const size_t leaves = far->hierarchy->leaves, first = (size_t)channel * leaves;
  double changed = 0, held = 0;
  for (size_t k = first; k < first + leaves; k++) {
    const clt_live_item *item = &far->item[k];
    float most = 0;
    for (int t = 0; t < CLT_LEAF_TERMS; t++) {
      most = fmaxf(most, fabsf(item->held[t] - item->known[t]));
    }
    changed += (double)most;
    held += (double)item->held[0];
  }
  far->bound[channel] = held > 0;
  far->pulled[channel] = far->pulled[channel] || held > 0;
  return held > 0 &&
         !(far->ready[channel] && (changed == 0 || (!renew && changed <= MOVED * (double)far->lit[channel])));
}

static bool keep_factors(clt_far *far, bool renew) {
  bool aged[CLT_CHANNELS_MAX] = {false}, any = false;
  for (int c = far->from; c < far->to; c++) {
    aged[c] = has_aged(far, c, renew);
    any = any || aged[c];
  }
  return !any || clt_factor_renew(far, aged);
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
static void give_again(clt_far *far) {
  clt_turns turns = clt_live_turns(far);
#pragma omp parallel if (far->shared)
  for (clt_live_item *item, *end; clt_live_next(far, &turns, &item, &end);) {
    for (; item < end; item++) {
      give(far, item);
    }
  }
}

/* Back half of the way to the best drive: the objective is convex, and both ends lie within the bounds. */
static void halve(const clt_live *live, clt_far *far, clt_live_result *result) {
  const int64_t since_ns = clt_clock_ns();
  const float *best = far->drive[far->best];
  float *x = far->drive[far->now];
  for (size_t at = 0; at < values_of(live); at++) {
    x[at] = 0.5f * (x[at] + best[at]);
  }
  give_again(far);
  result->ms[CLT_LIVE_SOLVE] += 1e3 * clt_clock_since(since_ns);
}

/* One Newton step, into the drive that is neither the last nor the best. */
static bool step(clt_far *far, bool renew, clt_live_result *result) {
  const int64_t since_ns = clt_clock_ns();
  const int next = far->now != 0 && far->best != 0 ? 0 : far->now != 1 && far->best != 1 ? 1 : 2;
  if (!keep_factors(far, renew)) {
    return false;
  }
  clt_turns turns = clt_live_turns(far);
#pragma omp parallel if (far->shared)
  {
    clt_newton_step(far);
    for (clt_live_item *item, *end; clt_live_next(far, &turns, &item, &end);) {
      for (; item < end; item++) {
        clt_newton_turn(far, item);
        far->kernels->move(far, item, far->drive[next]);
      }
    }
  }
  far->now = next;
  result->ms[CLT_LIVE_SOLVE] += 1e3 * clt_clock_since(since_ns);
  return true;
}

/* Whether another step fits the budget, as the last one took. */
static bool may_go_on(const clt_live *live, const frame *at, int steps) {
  const double spent = clt_clock_since(live->start_ns) + at->last_s, budget = 1e-3 * live->options.budget_ms;
  return steps < STEPS_MAX && at->stale < STALE_STEPS && !(budget > 0 && spent > budget);
}

/* From a drive of 0, at which ||b|| is left. There the bounds say little of which cells they will hold. */
static void start_cold(clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  reset(live);
  at->cold = true;
  at->gap = 0;
  at->least = INFINITY;
  far->open = true;
  aim(far, result);
  take_stock(far, at);
}

/* Back to the best drive. */
static void return_to_best(clt_far *far, clt_live_result *result) {
  far->now = far->best;
  give_again(far);
  look(far, result);
}

static void take_channels(clt_far *far, int from, int to) {
  far->from = from;
  far->to = to;
}

/* Whether the drive is to take a step for what was found of the first channel, and by that, as one frame is like the
 * one before, of all. A target that is the last one again is found to the bit as the drive was left: it is not. Where a
 * factor is to be taken anew, those of all channels are, at once. */
static bool is_due(const clt_live *live, clt_far *far, const frame *left, const frame *at) {
  const double enough = live->options.target_error * live->size, budget = 1e-3 * live->options.budget_ms;
  const bool same = at->gap == left->gap && at->objective == left->objective;
  return live->size > 0 && !same && at->objective < at->wanted && far->share * at->gap > enough * enough &&
         !(budget > 0 && far->last_s > budget) && !has_aged(far, 0, false);
}

/* Aims at the channels that were not, or at all after the first `stepped` of them took a step, which is taken back. */
static void aim_at_rest(clt_far *far, int stepped, clt_live_result *result) {
  if (stepped > 0) {
    take_channels(far, 0, stepped);
    return_to_best(far, result);
  }
  take_channels(far, stepped > 0 ? 0 : 1, far->channels);
  aim(far, result);
}

/* Aims, and where a step is due takes the first one: channel by channel, so that what is read of a channel is still in
 * the cache when it is moved and looked at. Whether a step was taken. */
static bool begin_apart(const clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  frame left = {0}, aimed = {0};
  double first = 0;
  int stepped = 0;
  far->best = far->now;
  take_channels(far, 0, 1);
  add_up(far, &left);
  for (int c = 0; c < far->channels && stepped == c; c++) {
    far->now = far->best;
    take_channels(far, c, c + 1);
    aim(far, result);
    add_up(far, &aimed);
    first = c == 0 ? aimed.gap : first;
    if (isfinite(aimed.size) && (c > 0 || is_due(live, far, &left, &aimed)) && step(far, false, result)) {
      look(far, result);
      stepped++;
    }
  }
  const bool all = stepped == far->channels;
  if (all) {
    at->least = aimed.objective;
    at->gap = aimed.gap;
    at->last_s = 1e-3 * (result->ms[CLT_LIVE_SOLVE] + result->ms[CLT_LIVE_ESTIMATE]);
  } else {
    aim_at_rest(far, stepped, result);
  }
  take_channels(far, 0, far->channels);
  take_stock(far, at);
  far->share = first > 0 ? (all ? aimed.gap : at->gap) / first : far->share;
  return all;
}

static void begin(const clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  if (far->apart) {
    result->steps = begin_apart(live, far, at, result);
  } else {
    aim(far, result);
    take_stock(far, at);
  }
}

/* Steps until the gap is closed; the residual of the drive that is kept is known then. A start that is worse than none,
 * and one from which steps cease to gain, is given up for a cold one. */
static void run(clt_live *live, clt_far *far, frame *at, clt_live_result *result) {
  const double enough = live->options.target_error * live->size;
  if (at->objective >= at->wanted && at->gap > enough * enough) {
    start_cold(live, far, at, result);
  }
  while (!(result->converged = is_near(far, at, enough, result))) {
    if (at->stale >= STALE_STEPS && !at->cold) {
      start_cold(live, far, at, result);
    }
    const int64_t since_ns = clt_clock_ns();
    if (!may_go_on(live, at, result->steps)) {
      break;
    }
    if (at->objective > WORSE * at->least) {
      halve(live, far, result);
    } else if (!step(far, at->renew, result)) {
      break;
    }
    far->open = false;
    result->steps++;
    look(far, result);
    take_stock(far, at);
    at->last_s = clt_clock_since(since_ns);
  }
  far->open = false;
}

/* The drive that is kept, to the caller. */
static void hand_over(const clt_live *live, const clt_far *far, float *drive) {
  enum { AT_ONCE = 4096 };
  const float *kept = far->drive[far->now];
  clt_turns turns = clt_turns_of_few(values_of(live), AT_ONCE);
#pragma omp parallel if (far->shared)
  for (size_t first, end; clt_turns_next_few(&turns, values_of(live), AT_ONCE, &first, &end);) {
    memcpy(drive + first, kept + first, (end - first) * sizeof *drive);
  }
}

static clt_status solve_frame(clt_live *live, const float *target, float *drive, clt_live_result *result,
                              clt_error *error) {
  clt_far *far = live->own;
  frame at = {.least = INFINITY};
  far->target = target;
  begin(live, far, &at, result);
  const clt_status status = clt_live_measure(live, at.size, error);
  if (status != CLT_OK) {
    return status;
  }
  run(live, far, &at, result);
  if (!result->converged && far->now != far->best) {
    return_to_best(far, result);
    take_stock(far, &at);
  }
  hand_over(live, far, drive);
  size_t lit = 0;
  for (int c = 0; c < live->info.channels; c++) {
    lit += far->lit[c];
  }
  result->residual = sqrt(at.objective) / live->size;
  result->clipped_fraction = lit > 0 ? at.held / (double)lit : 0;
  live->seen = sqrt(at.seen) / live->size;
  far->last_s = clt_clock_since(live->start_ns);
  return CLT_OK;
}

const clt_live_form clt_live_hierarchic = {create, destroy, reset, solve_frame};
