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

static const float *factor_of(const clt_far *far, const float *factor, int channel) {
  return factor + (size_t)channel * TERMS * leaves_of(far) * far->rank;
}

static const float *left_of(const clt_far *far, int channel) {
  return factor_of(far, far->hierarchy->left, channel);
}

static const float *right_of(const clt_far *far, int channel) {
  return factor_of(far, far->hierarchy->right, channel);
}

static clt_live_item *items_of(const clt_far *far, int channel) {
  return far->item + (size_t)channel * leaves_of(far);
}

static float *of_channel(float *all, size_t each, int channel) {
  return all + (size_t)channel * each;
}

clt_status clt_newton_create(clt_far *far, clt_error *error) {
  const size_t rank = far->rank, channels = (size_t)far->channels;
  far->small = clt_alloc(channels * rank, (4 + 2 * CHUNKS + rank) * sizeof *far->small);
  if (far->small == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for steps over far light of rank %zu", rank);
  }
  far->z = far->small;
  far->q = far->z + channels * rank;
  far->right = far->q + channels * rank;
  far->partial = far->right + channels * 2 * rank;
  far->gram = far->partial + channels * CHUNKS * 2 * rank;
  return clt_factor_create(far, error);
}

void clt_newton_destroy(clt_far *far) {
  clt_factor_destroy(far);
  free(far->small);
}

/* partial = factor' of what the items of a chunk hold at `offset`, over the first columns. */
static void sum_chunk(const clt_far *far, int channel, size_t chunk, const float *factor, size_t columns, size_t offset,
                      float *partial) {
  const size_t leaves = leaves_of(far), rank = far->rank;
  const clt_live_item *item = items_of(far, channel);
  memset(partial, 0, columns * sizeof *partial);
  for (size_t k = leaves * chunk / CHUNKS; k < leaves * (chunk + 1) / CHUNKS; k++) {
    const float *term = (const float *)(const void *)((const char *)&item[k] + offset);
    if (term[0] != 0 || term[1] != 0 || term[2] != 0 || term[3] != 0) {
      far->kernels->add_rows(factor + TERMS * k * rank, rank, columns, term, partial);
    }
  }
}

static float *partial_of(const clt_far *far, int channel, size_t chunk) {
  return far->partial + ((size_t)channel * CHUNKS + chunk) * 2 * far->rank;
}

/* partial = factor' of what the items hold at `offset`, of every channel and chunk: factor is left or right, whole. */
static void sum_items(const clt_far *far, const float *factor, size_t offset) {
#pragma omp for schedule(static)
  for (int k = 0; k < far->channels * CHUNKS; k++) {
    const size_t chunk = (size_t)(k % CHUNKS);
    sum_chunk(far, k / CHUNKS, chunk, factor_of(far, factor, k / CHUNKS), far->rank, offset,
              partial_of(far, k / CHUNKS, chunk));
  }
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

/* Right sides into answers: dz stays in far->right, dq goes into q. */
static void solve_channel(clt_far *far, int channel) {
  const size_t rank = far->rank, count = far->coupled[channel];
  float *answer = of_channel(far->right, 2 * rank, channel), *q = of_channel(far->q, rank, channel);
  float *taken = answer + count;
  fold_chunks(far, channel, 0, count, answer);
  if (far->pulled[channel]) {
    fold_chunks(far, channel, rank, count, taken);
    fold_chunks(far, channel, rank + count, rank - count, q + count);
    for (size_t r = 0; r < count; r++) {
      taken[r] -= q[r];
    }
  } else {
    memset(taken, 0, count * sizeof *taken);
  }
  clt_factor_solve(far, channel, answer);
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
#pragma omp for schedule(static)
  for (int k = 0; k < far->channels * CHUNKS; k++) {
    const int channel = k / CHUNKS;
    const size_t chunk = (size_t)(k % CHUNKS);
    float *partial = partial_of(far, channel, chunk);
    sum_chunk(far, channel, chunk, right_of(far, channel), far->coupled[channel], offsetof(clt_live_item, give),
              partial);
    if (far->pulled[channel]) {
      sum_chunk(far, channel, chunk, left_of(far, channel), far->rank, offsetof(clt_live_item, take),
                partial + far->rank);
    }
  }
#pragma omp for schedule(dynamic, 1)
  for (int channel = 0; channel < far->channels; channel++) {
    solve_channel(far, channel);
  }
}

void clt_newton_turn(const clt_far *far, clt_live_item *item) {
  const size_t at = TERMS * item->leaf * far->rank, rank = far->rank;
  const int channel = item->channel;
  far->kernels->dot_rows(left_of(far, channel) + at, rank, far->coupled[channel],
                         of_channel(far->right, 2 * rank, channel), item->turn);
  if (far->pulled[channel]) {
    far->kernels->dot_rows(right_of(far, channel) + at, rank, rank, of_channel(far->q, rank, channel), item->pull);
  } else {
    memset(item->pull, 0, sizeof item->pull);
  }
}

void clt_newton_gather(clt_far *far) {
  sum_items(far, far->hierarchy->right, offsetof(clt_live_item, given));
#pragma omp for schedule(dynamic, 1)
  for (int channel = 0; channel < far->channels; channel++) {
    double light = 0;
    for (size_t k = 0; k < leaves_of(far); k++) {
      light += items_of(far, channel)[k].light;
    }
    far->mean[channel] = (float)(light / (double)far->cells);
    fold_chunks(far, channel, 0, far->rank, of_channel(far->z, far->rank, channel));
  }
}

void clt_newton_light(const clt_far *far, clt_live_item *item) {
  far->kernels->dot_rows(left_of(far, item->channel) + TERMS * item->leaf * far->rank, far->rank, far->rank,
                         of_channel(far->z, far->rank, item->channel), item->far);
}

/* ||D^-1 V (U'r - q)||^2, of one channel. */
static double drift_of(clt_far *far, int channel) {
  const size_t rank = far->rank;
  const float *gram = of_channel(far->gram, rank * rank, channel), *q = of_channel(far->q, rank, channel);
  float *apart = of_channel(far->right, 2 * rank, channel);
  double sum = 0;
  fold_chunks(far, channel, 0, rank, apart);
  for (size_t r = 0; r < rank; r++) {
    apart[r] -= q[r];
  }
  for (size_t r = 0; r < rank; r++) {
    float row = 0;
    for (size_t k = 0; k < rank; k++) {
      row += gram[r * rank + k] * apart[k];
    }
    sum += (double)row * (double)apart[r];
  }
  return fmax(sum, 0);
}

void clt_newton_drift(clt_far *far, double drift[CLT_CHANNELS_MAX]) {
  sum_items(far, far->hierarchy->left, offsetof(clt_live_item, whole));
#pragma omp for schedule(dynamic, 1)
  for (int channel = 0; channel < far->channels; channel++) {
    drift[channel] = drift_of(far, channel);
  }
}
