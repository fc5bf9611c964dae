/* Steps of Newton's method between the light that leaves give and the light that they take. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/live_factor.h"

enum { TERMS = CLT_LEAF_TERMS, CHUNKS = CLT_HIERARCHY_CHUNKS };

static size_t leaves_of(const clt_far *far) {
  return far->hierarchy->leaves;
}

static clt_live_item *items_of(const clt_far *far, int channel) {
  return far->item + (size_t)channel * leaves_of(far);
}

static float *of_channel(float *all, size_t each, int channel) {
  return all + (size_t)channel * each;
}

clt_status clt_newton_create(clt_far *far, clt_error *error) {
  const size_t rank = far->rank, channels = (size_t)far->channels;
  far->small = clt_alloc(channels * rank, (6 + 2 * CHUNKS + rank) * sizeof *far->small);
  if (far->small == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for steps over far light of rank %zu", rank);
  }
  far->z = far->small;
  far->q = far->z + channels * rank;
  far->right = far->q + channels * rank;
  far->turned = far->right + channels * 2 * rank;
  far->folded = far->turned + channels * rank;
  far->partial = far->folded + channels * rank;
  far->gram = far->partial + channels * CHUNKS * 2 * rank;
  return clt_factor_create(far, error);
}

void clt_newton_destroy(clt_far *far) {
  clt_factor_destroy(far);
  free(far->small);
}

/* partial = rows' of what the items of a chunk hold at `offset`, over the first columns. */
static void sum_chunk(const clt_far *far, int channel, size_t chunk, const clt_leaf_rows *rows, size_t columns,
                      size_t offset, float *partial) {
  const size_t leaves = leaves_of(far);
  const clt_live_item *item = items_of(far, channel);
  memset(partial, 0, columns * sizeof *partial);
  for (size_t k = leaves * chunk / CHUNKS; k < leaves * (chunk + 1) / CHUNKS; k++) {
    const float *term = (const float *)(const void *)((const char *)&item[k] + offset);
    if (term[0] != 0 || term[1] != 0 || term[2] != 0 || term[3] != 0) {
      clt_leaf_rows_add(rows, channel, k, term, columns, partial);
    }
  }
}

static float *partial_of(const clt_far *far, int channel, size_t chunk) {
  return far->partial + ((size_t)channel * CHUNKS + chunk) * 2 * far->rank;
}

/* partial = rows' of what the items hold at `offset`, of every channel and chunk; channels that share rows read them
 * one after the other. */
static void sum_items(const clt_far *far, const clt_leaf_rows *rows, size_t offset) {
#pragma omp for schedule(static)
  for (int k = 0; k < (far->to - far->from) * CHUNKS; k++) {
    const int channel = far->from + k % (far->to - far->from);
    const size_t chunk = (size_t)(k / (far->to - far->from));
    sum_chunk(far, channel, chunk, rows, far->rank, offset, partial_of(far, channel, chunk));
  }
}

/* The columns that are coupled, in whole steps. */
static size_t coupled_steps(const clt_far *far, int channel) {
  const size_t whole = (far->coupled[channel] + CLT_RANK_STEP - 1) / CLT_RANK_STEP * CLT_RANK_STEP;
  return whole < far->rank ? whole : far->rank;
}

/* out = the sum of a channel's partial sums, from `first` on. */
static void fold_chunks(const clt_far *far, int channel, size_t first, size_t count, float *out) {
  memset(out, 0, count * sizeof *out);
  for (size_t chunk = 0; chunk < CHUNKS; chunk++) {
    const float *partial = partial_of(far, channel, chunk) + first;
    for (size_t r = 0; r < count; r++) {
      out[r] += partial[r];
    }
  }
}

/* out = U'(...) from what was summed over the left side's rows: the core is theirs. */
static void fold_taken(const clt_far *far, int channel, size_t first, float *out) {
  float *folded = of_channel(far->folded, far->rank, channel);
  fold_chunks(far, channel, first, far->rank, folded);
  clt_hierarchic_core(far->hierarchy, channel, true, folded, out);
}

/* dz as the left side takes it. */
static void turn_answer(const clt_far *far, int channel, const float *answer) {
  const size_t rank = far->rank, count = far->coupled[channel];
  float *padded = of_channel(far->folded, rank, channel);
  memcpy(padded, answer, count * sizeof *padded);
  memset(padded + count, 0, (rank - count) * sizeof *padded);
  clt_hierarchic_core(far->hierarchy, channel, false, padded, of_channel(far->turned, rank, channel));
}

/* Right sides into answers: dz stays in far->right and, turned, in far->turned; dq goes into q. */
static void solve_channel(clt_far *far, int channel) {
  const size_t rank = far->rank, count = far->coupled[channel];
  float *answer = of_channel(far->right, 2 * rank, channel), *q = of_channel(far->q, rank, channel);
  float *taken = answer + count, *all = of_channel(far->turned, rank, channel);
  fold_chunks(far, channel, 0, count, answer);
  if (far->pulled[channel]) {
    fold_taken(far, channel, rank, all);
    memcpy(q + count, all + count, (rank - count) * sizeof *q);
    for (size_t r = 0; r < count; r++) {
      taken[r] = all[r] - q[r];
    }
  } else {
    memset(taken, 0, count * sizeof *taken);
  }
  clt_factor_solve(far, channel, answer);
  turn_answer(far, channel, answer);
  far->pulled[channel] = far->bound[channel];
  if (far->bound[channel]) {
    for (size_t r = 0; r < count; r++) {
      q[r] += taken[r];
    }
  } else {
    memset(q, 0, rank * sizeof *q);
  }
}

void clt_newton_step(clt_far *far) {
  const clt_hierarchy_storage *of = far->hierarchy;
#pragma omp for schedule(static)
  for (int k = 0; k < (far->to - far->from) * CHUNKS; k++) {
    const int channel = far->from + k % (far->to - far->from);
    const size_t chunk = (size_t)(k / (far->to - far->from));
    float *partial = partial_of(far, channel, chunk);
    sum_chunk(far, channel, chunk, &of->right, coupled_steps(far, channel), offsetof(clt_live_item, give), partial);
    if (far->pulled[channel]) {
      sum_chunk(far, channel, chunk, &of->left, far->rank, offsetof(clt_live_item, take), partial + far->rank);
    }
  }
#pragma omp for schedule(dynamic, 1)
  for (int channel = far->from; channel < far->to; channel++) {
    solve_channel(far, channel);
  }
}

void clt_newton_turn(const clt_far *far, clt_live_item *item) {
  const clt_hierarchy_storage *of = far->hierarchy;
  const int channel = item->channel;
  clt_leaf_rows_dot(&of->left, channel, item->leaf, of_channel(far->turned, far->rank, channel),
                    of->core != NULL ? far->rank : coupled_steps(far, channel), item->turn);
  if (far->pulled[channel]) {
    clt_leaf_rows_dot(&of->right, channel, item->leaf, of_channel(far->q, far->rank, channel), far->rank, item->pull);
  } else {
    memset(item->pull, 0, sizeof item->pull);
  }
}

void clt_newton_gather(clt_far *far) {
  sum_items(far, &far->hierarchy->right, offsetof(clt_live_item, given));
#pragma omp for schedule(dynamic, 1)
  for (int channel = far->from; channel < far->to; channel++) {
    float *folded = of_channel(far->folded, far->rank, channel);
    double light = 0;
    for (size_t k = 0; k < leaves_of(far); k++) {
      light += items_of(far, channel)[k].light;
    }
    far->mean[channel] = (float)(light / (double)far->cells);
    fold_chunks(far, channel, 0, far->rank, folded);
    clt_hierarchic_core(far->hierarchy, channel, false, folded, of_channel(far->z, far->rank, channel));
  }
}

void clt_newton_light(const clt_far *far, clt_live_item *item) {
  clt_leaf_rows_dot(&far->hierarchy->left, item->channel, item->leaf, of_channel(far->z, far->rank, item->channel),
                    far->rank, item->far);
}

/* ||D^-1 V (U'r - q)||^2, of one channel. The gram is symmetric: its rows are added up, which goes by vectors. */
static double drift_of(clt_far *far, int channel) {
  const size_t rank = far->rank;
  const float *gram = of_channel(far->gram, rank * rank, channel), *q = of_channel(far->q, rank, channel);
  float *apart = of_channel(far->right, 2 * rank, channel), *row = apart + rank;
  double sum = 0;
  fold_taken(far, channel, 0, apart);
  for (size_t r = 0; r < rank; r++) {
    apart[r] -= q[r];
    row[r] = 0;
  }
  for (size_t r = 0; r < rank; r++) {
    for (size_t k = 0; k < rank; k++) {
      row[k] += apart[r] * gram[r * rank + k];
    }
  }
  for (size_t r = 0; r < rank; r++) {
    sum += (double)row[r] * (double)apart[r];
  }
  return fmax(sum, 0);
}

void clt_newton_drift(clt_far *far, double drift[CLT_CHANNELS_MAX]) {
  sum_items(far, &far->hierarchy->left, offsetof(clt_live_item, whole));
#pragma omp for schedule(dynamic, 1)
  for (int channel = far->from; channel < far->to; channel++) {
    drift[channel] = drift_of(far, channel);
  }
}
