/* The small systems of a Newton step. */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/live_far.h"

enum {
  TERMS = CLT_LEAF_TERMS,
  COUPLED_LEAST = 64, /* columns, whose factor costs next to nothing */
  CHUNKS = CLT_HIERARCHY_CHUNKS
};
/* Of a cell's own light: far light of smaller singular values is not coupled. */
static const float COUPLED = 0.05f;

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

static clt_status reserve(clt_far *far, clt_error *error) {
  const size_t rank = far->rank, channels = (size_t)far->channels;
  far->small = clt_alloc(channels * rank, (4 + 2 * CHUNKS + rank) * sizeof *far->small);
  far->tall = clt_alloc(TERMS * leaves_of(far) * rank, sizeof *far->tall);
  if (far->small == NULL || far->tall == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for steps over far light of rank %zu", rank);
  }
  far->z = far->small;
  far->q = far->z + channels * rank;
  far->right = far->q + channels * rank;
  far->partial = far->right + channels * 2 * rank;
  far->gram = far->partial + channels * CHUNKS * 2 * rank;
  return CLT_OK;
}

void clt_newton_destroy(clt_far *far) {
  free(far->small);
  free(far->factor);
  free(far->pivots);
  free(far->tall);
}

/* tall = M factor, M the moments of one weight over every leaf: the entry of the terms u^a v^b and u^c v^d is the
 * moment of u^(a+c) v^(b+d). Only the first columns of the factor are taken. */
static void weigh_factor(const clt_far *far, int channel, int weight, const float *factor, size_t columns,
                         float *tall) {
  const clt_live_item *item = items_of(far, channel);
  const size_t rank = far->rank;
#pragma omp parallel for schedule(static) if (far->shared)
  for (size_t leaf = 0; leaf < leaves_of(far); leaf++) {
    const float *moment = item[leaf].weight[weight], *from = factor + TERMS * leaf * rank;
    for (size_t s = 0; s < TERMS; s++) {
      float *to = tall + (TERMS * leaf + s) * columns;
      const float m0 = moment[3 * (s / 2) + s % 2], m1 = moment[3 * (s / 2) + s % 2 + 1];
      const float m2 = moment[3 * (s / 2 + 1) + s % 2], m3 = moment[3 * (s / 2 + 1) + s % 2 + 1];
      for (size_t r = 0; r < columns; r++) {
        to[r] = (m0 * from[r] + m1 * from[rank + r]) + (m2 * from[2 * rank + r] + m3 * from[3 * rank + r]);
      }
    }
  }
}

/* block = factor' M other over the first columns, column-major with `stride` between columns. */
static void weigh_product(const clt_far *far, int channel, int weight, const float *factor, const float *other,
                          size_t columns, float sign, float *block, size_t stride) {
  const blasint count = (blasint)columns, nodes = (blasint)(TERMS * leaves_of(far));
  weigh_factor(far, channel, weight, other, columns, far->tall);
  cblas_sgemm(CblasColMajor, CblasNoTrans, CblasTrans, count, count, nodes, sign, factor, (blasint)far->rank, far->tall,
              count, 0, block, (blasint)stride);
}

static void weigh_items(const clt_far *far, int channel) {
  clt_live_item *item = items_of(far, channel);
#pragma omp parallel for schedule(dynamic, 8) if (far->shared)
  for (size_t k = 0; k < leaves_of(far); k++) {
    far->kernels->weigh(far, &item[k]);
  }
}

/* squares_r = factor_r' M factor_r, M the moments of v k / D. */
static void measure_columns(const clt_far *far, int channel, const float *factor, double *squares) {
  const size_t rank = far->rank;
  weigh_factor(far, channel, 0, factor, rank, far->tall);
  memset(squares, 0, rank * sizeof *squares);
  for (size_t m = 0; m < TERMS * leaves_of(far); m++) {
    for (size_t r = 0; r < rank; r++) {
      squares[r] += (double)factor[m * rank + r] * (double)far->tall[m * rank + r];
    }
  }
}

/* What is known of a channel where no cell is held: V' D^-2 V, and how many columns of far light are coupled, all up
 * to the last that is not small. */
static clt_status prepare_channel(clt_far *far, int channel, clt_error *error) {
  const size_t rank = far->rank;
  double *left = clt_alloc(2 * rank, sizeof *left), *right = left + rank;
  if (left == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for far light of rank %zu", rank);
  }
  weigh_items(far, channel);
  weigh_product(far, channel, 1, right_of(far, channel), right_of(far, channel), rank, 1,
                of_channel(far->gram, rank * rank, channel), rank);
  measure_columns(far, channel, left_of(far, channel), left);
  measure_columns(far, channel, right_of(far, channel), right);
  far->coupled[channel] = rank < COUPLED_LEAST ? rank : COUPLED_LEAST;
  for (size_t r = 0; r < rank; r++) {
    if (r >= far->coupled[channel] && left[r] * right[r] > (double)COUPLED * (double)COUPLED) {
      far->coupled[channel] = r + 1;
    }
  }
  free(left);
  return CLT_OK;
}

/* The factor of a channel that serves now, and its pivots. */
static float *factor_now(const clt_far *far, int channel) {
  return far->factor + (2 * (size_t)channel + far->bound[channel]) * far->order * far->order;
}

static int *pivots_now(const clt_far *far, int channel) {
  return far->pivots + (2 * (size_t)channel + far->bound[channel]) * far->order;
}

static clt_status factor_free(clt_far *far, clt_error *error) {
  const size_t channels = (size_t)far->channels;
  for (int c = 0; c < far->channels; c++) {
    far->order = 2 * far->coupled[c] > far->order ? 2 * far->coupled[c] : far->order;
  }
  far->factor = clt_alloc(2 * channels * far->order, far->order * sizeof *far->factor);
  far->pivots = clt_alloc(2 * channels, far->order * sizeof *far->pivots);
  if (far->factor == NULL || far->pivots == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for factors of far light of rank %zu", far->rank);
  }
  for (int c = 0; c < far->channels; c++) {
    if (!clt_newton_factor(far, c)) {
      return clt_fail(error, CLT_FAILED, "far light of rank %zu has a singular factor", far->rank);
    }
    far->ready[c] = false;
  }
  return CLT_OK;
}

clt_status clt_newton_create(clt_far *far, clt_error *error) {
  clt_status status = reserve(far, error);
  far->open = true;
  for (int c = 0; status == CLT_OK && c < far->channels; c++) {
    status = prepare_channel(far, c, error);
  }
  if (status == CLT_OK) {
    status = factor_free(far, error);
  }
  far->open = false;
  return status;
}

/* The matrix above, of the columns that are coupled. */
bool clt_newton_factor(clt_far *far, int channel) {
  const size_t count = far->coupled[channel], order = 2 * count;
  const float *left = left_of(far, channel), *right = right_of(far, channel);
  float *matrix = factor_now(far, channel);
  weigh_items(far, channel);
  weigh_product(far, channel, 0, right, left, count, 1, matrix, order); /* G */
  for (size_t j = 0; j < count; j++) {
    for (size_t i = 0; i < count; i++) {
      matrix[(count + i) * order + count + j] = matrix[j * order + i] + (i == j ? 1.0f : 0.0f);
    }
  }
  for (size_t j = 0; j < count; j++) {
    matrix[j * order + j] += 1;
  }
  weigh_product(far, channel, 1, right, right, count, -1, matrix + count * order, order); /* -H */
  weigh_product(far, channel, 2, left, left, count, 1, matrix + count, order);            /* N */
  for (clt_live_item *item = items_of(far, channel); item < items_of(far, channel) + leaves_of(far); item++) {
    memcpy(item->known, item->held, sizeof item->known);
  }
  far->ready[channel] = LAPACKE_sgetrf_work(LAPACK_COL_MAJOR, (lapack_int)order, (lapack_int)order, matrix,
                                            (lapack_int)order, pivots_now(far, channel)) == 0;
  return far->ready[channel];
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
#pragma omp for schedule(dynamic, 1)
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
  const size_t rank = far->rank, count = far->coupled[channel], order = 2 * count;
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
  LAPACKE_sgetrs_work(LAPACK_COL_MAJOR, 'N', (lapack_int)order, 1, factor_now(far, channel), (lapack_int)order,
                      pivots_now(far, channel), answer, (lapack_int)order);
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
#pragma omp for schedule(dynamic, 1)
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
