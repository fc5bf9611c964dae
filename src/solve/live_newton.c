/* The small systems of a Newton step. */
#include <cblas.h>
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "solve/live_far.h"

enum { TERMS = CLT_LEAF_TERMS };

static size_t leaves_of(const clt_far *far) {
  return far->hierarchy->leaves;
}

static const float *factor_of(const clt_far *far, const float *factor, int channel) {
  return factor + (size_t)channel * TERMS * leaves_of(far) * far->rank;
}

static clt_live_item *items_of(const clt_far *far, int channel) {
  return far->item + (size_t)channel * leaves_of(far);
}

clt_status clt_newton_reserve(clt_far *far, int channels, clt_error *error) {
  const size_t rank = far->rank, count = (size_t)channels;
  far->z = clt_alloc(rank, count * sizeof *far->z);
  far->q = clt_alloc(rank, count * sizeof *far->q);
  far->right = clt_alloc(2 * rank, count * sizeof *far->right);
  far->factor = clt_alloc(4 * rank * rank, count * sizeof *far->factor);
  far->pivots = clt_alloc(2 * rank, count * sizeof *far->pivots);
  far->tall = clt_alloc(TERMS * leaves_of(far) * rank, sizeof *far->tall);
  const bool all = far->z != NULL && far->q != NULL && far->right != NULL && far->factor != NULL &&
                   far->pivots != NULL && far->tall != NULL;
  return all ? CLT_OK : clt_fail(error, CLT_FAILED, "no memory for steps over far light of rank %zu", rank);
}

void clt_newton_release(clt_far *far) {
  free(far->z);
  free(far->q);
  free(far->right);
  free(far->factor);
  free(far->pivots);
  free(far->tall);
}

/* tall = M factor, M the moments of one weight over every leaf: the entry of the terms u^a v^b and u^c v^d is the
 * moment of u^(a+c) v^(b+d). */
static void weigh_factor(const clt_far *far, int channel, int weight, const float *factor, float *tall) {
  const clt_live_item *item = items_of(far, channel);
  const size_t rank = far->rank;
  for (size_t leaf = 0; leaf < leaves_of(far); leaf++) {
    const float *moment = item[leaf].weight[weight], *from = factor + TERMS * leaf * rank;
    for (size_t s = 0; s < TERMS; s++) {
      float *to = tall + (TERMS * leaf + s) * rank;
      const float m0 = moment[3 * (s / 2) + s % 2], m1 = moment[3 * (s / 2) + s % 2 + 1];
      const float m2 = moment[3 * (s / 2 + 1) + s % 2], m3 = moment[3 * (s / 2 + 1) + s % 2 + 1];
      for (size_t r = 0; r < rank; r++) {
        to[r] = (m0 * from[r] + m1 * from[rank + r]) + (m2 * from[2 * rank + r] + m3 * from[3 * rank + r]);
      }
    }
  }
}

/* block = factor' tall, into a column-major matrix of 2R rows. */
static void multiply(const clt_far *far, const float *factor, const float *tall, float sign, float *block) {
  const blasint rank = (blasint)far->rank, nodes = (blasint)(TERMS * leaves_of(far));
  cblas_sgemm(CblasColMajor, CblasNoTrans, CblasTrans, rank, rank, nodes, sign, factor, rank, tall, rank, 0, block,
              2 * rank);
}

bool clt_newton_factor(clt_far *far, int channel) {
  const size_t rank = far->rank, order = 2 * rank;
  const float *left = factor_of(far, far->hierarchy->left, channel);
  const float *right = factor_of(far, far->hierarchy->right, channel);
  float *matrix = far->factor + (size_t)channel * order * order;
  float *tall = far->tall;
  weigh_factor(far, channel, 0, left, tall);
  multiply(far, right, tall, 1, matrix); /* G = B' M A */
  for (size_t j = 0; j < rank; j++) {
    for (size_t i = 0; i < rank; i++) {
      matrix[(rank + i) * order + rank + j] = matrix[j * order + i] + (i == j ? 1.0f : 0.0f);
    }
  }
  for (size_t j = 0; j < rank; j++) {
    matrix[j * order + j] += 1;
  }
  weigh_factor(far, channel, 1, right, tall);
  multiply(far, right, tall, -1, matrix + rank * order);
  weigh_factor(far, channel, 2, left, tall);
  multiply(far, left, tall, 1, matrix + rank);
  return LAPACKE_sgetrf_work(LAPACK_COL_MAJOR, (lapack_int)order, (lapack_int)order, matrix, (lapack_int)order,
                             far->pivots + (size_t)channel * order) == 0;
}

/* out = factor' of what the items hold at `offset`. */
static void sum_items(const clt_far *far, int channel, const float *factor, size_t offset, float *out) {
  const clt_live_item *item = items_of(far, channel);
  memset(out, 0, far->rank * sizeof *out);
  for (size_t m = 0; m < TERMS * leaves_of(far); m++) {
    const float *terms = (const float *)(const void *)((const char *)&item[m / TERMS] + offset);
    const float *row = factor + m * far->rank;
    const float value = terms[m % TERMS];
    for (size_t r = 0; r < far->rank; r++) {
      out[r] += value * row[r];
    }
  }
}

/* What the items hold at `offset` = factor in. */
static void spread_items(const clt_far *far, int channel, const float *factor, const float *in, size_t offset) {
  clt_live_item *item = items_of(far, channel);
  enum { LANES = 8 };
  for (size_t m = 0; m < TERMS * leaves_of(far); m++) {
    const float *row = factor + m * far->rank;
    float lane[LANES] = {0}, sum = 0;
    size_t r = 0;
    for (; r + LANES <= far->rank; r += LANES) {
      for (size_t l = 0; l < LANES; l++) {
        lane[l] += row[r + l] * in[r + l];
      }
    }
    for (; r < far->rank; r++) {
      sum += row[r] * in[r];
    }
    for (size_t l = 0; l < LANES; l++) {
      sum += lane[l];
    }
    ((float *)(void *)((char *)&item[m / TERMS] + offset))[m % TERMS] = sum;
  }
}

void clt_newton_step(clt_far *far, int channel) {
  const size_t rank = far->rank, order = 2 * rank;
  const float *left = factor_of(far, far->hierarchy->left, channel);
  const float *right = factor_of(far, far->hierarchy->right, channel);
  float *answer = far->right + (size_t)channel * order;
  sum_items(far, channel, right, offsetof(clt_live_item, free), answer);
  sum_items(far, channel, left, offsetof(clt_live_item, held), answer + rank);
  LAPACKE_sgetrs_work(LAPACK_COL_MAJOR, 'N', (lapack_int)order, 1, far->factor + (size_t)channel * order * order,
                      (lapack_int)order, far->pivots + (size_t)channel * order, answer, (lapack_int)order);
  spread_items(far, channel, left, answer, offsetof(clt_live_item, turn));
  spread_items(far, channel, right, answer + rank, offsetof(clt_live_item, pull));
  memcpy(far->q + (size_t)channel * rank, answer + rank, rank * sizeof *answer);
}

double clt_newton_drift(clt_far *far, int channel) {
  const size_t rank = far->rank;
  float *apart = far->right + (size_t)channel * 2 * rank;
  double sum = 0;
  sum_items(far, channel, factor_of(far, far->hierarchy->left, channel), offsetof(clt_live_item, whole), apart);
  for (size_t r = 0; r < rank; r++) {
    apart[r] -= far->q[(size_t)channel * rank + r];
  }
  spread_items(far, channel, factor_of(far, far->hierarchy->right, channel), apart, offsetof(clt_live_item, drift));
  for (const clt_live_item *item = items_of(far, channel); item < items_of(far, channel) + leaves_of(far); item++) {
    /* the means of u^2 and v^2 over a leaf are a third at most */
    const double mean = (double)(item->drift[0] * item->drift[0]) +
                        (double)(item->drift[1] * item->drift[1] + item->drift[2] * item->drift[2]) / 3 +
                        (double)(item->drift[3] * item->drift[3]) / 9;
    sum += mean * (double)item->turnover;
  }
  return sum;
}

void clt_newton_gather(clt_far *far, int channel) {
  double light = 0;
  for (size_t leaf = 0; leaf < leaves_of(far); leaf++) {
    light += items_of(far, channel)[leaf].light;
  }
  far->mean[channel] = (float)(light / (double)far->cells);
  float *z = far->z + (size_t)channel * far->rank;
  sum_items(far, channel, factor_of(far, far->hierarchy->right, channel), offsetof(clt_live_item, given), z);
  spread_items(far, channel, factor_of(far, far->hierarchy->left, channel), z, offsetof(clt_live_item, far));
}
