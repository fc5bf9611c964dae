/* Gauss-Newton on log X_ba - log X_ab = p . (f_a - f_b), f_a the mean of the polynomial's terms over block a, weighted
 * by the light that the pair exchanges. A weak pull to p = 0 decides what the blocks do not. */
#include "acquire/flux_fit.h"

#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { TERMS = 5, STEPS = 3 };
#define PULL 1e-3 /* of the sum of the weights */
#define LEAST 3.0 /* deviations that X must be above its noise */

typedef struct fit {
  const clt_partition *partition;
  const unsigned char *dark;
  float *flux;
  double *exchange; /* X, [a * count + b] */
  double *terms;    /* f, [a * TERMS + t] */
  double *flux_sum; /* of w^2 over a block: the noise of X in units of a value's */
} fit;

static void fill_terms(const clt_partition *partition, size_t cell, double terms[TERMS]) {
  const double x = (2.0 * (double)(cell % (size_t)partition->width) + 1) / partition->width - 1;
  const double y = (2.0 * (double)(cell / (size_t)partition->width) + 1) / partition->height - 1;
  const double all[TERMS] = {x, y, x * x, x * y, y * y};
  memcpy(terms, all, sizeof all);
}

static void sum_terms(fit *own, size_t cells) {
  const size_t count = (size_t)own->partition->count;
  double *weight = own->flux_sum;
  memset(own->terms, 0, count * TERMS * sizeof *own->terms);
  memset(weight, 0, count * sizeof *weight);
  for (size_t j = 0; j < cells; j++) {
    const size_t a = (size_t)own->partition->label[j];
    const double w = (double)own->flux[j];
    double terms[TERMS];
    fill_terms(own->partition, j, terms);
    for (int t = 0; t < TERMS; t++) {
      own->terms[a * TERMS + (size_t)t] += w * terms[t];
    }
    weight[a] += w;
  }
  for (size_t k = 0; k < count * TERMS; k++) {
    own->terms[k] /= weight[k / TERMS] > 0 ? weight[k / TERMS] : 1;
  }
}

static void sum_exchange(fit *own, float *const *columns, size_t cells) {
  const clt_partition *partition = own->partition;
  const size_t count = (size_t)partition->count;
  memset(own->exchange, 0, count * count * sizeof *own->exchange);
  for (int c = 0; c < partition->channels; c++) {
#pragma omp parallel for schedule(static)
    for (size_t b = 0; b < count; b++) {
      for (size_t i = 0; i < cells; i++) {
        own->exchange[(size_t)partition->label[i] * count + b] +=
            (double)own->flux[i] * (double)columns[b][(size_t)c * cells + i] / partition->scale[c];
      }
    }
  }
  memset(own->flux_sum, 0, count * sizeof *own->flux_sum);
  for (size_t j = 0; j < cells; j++) {
    own->flux_sum[partition->label[j]] += (double)own->flux[j] * (double)own->flux[j];
  }
}

/* Adds what one pair of blocks says to the normal equations. */
static double add_pair(const fit *own, size_t a, size_t b, double normal[TERMS * TERMS], double right[TERMS]) {
  const size_t count = (size_t)own->partition->count;
  const double forth = own->exchange[a * count + b], back = own->exchange[b * count + a];
  const double noise = LEAST * sqrt(fmax(own->partition->variance[b] * own->flux_sum[a],
                                         own->partition->variance[a] * own->flux_sum[b]));
  if (!(forth > noise && back > noise && forth > 0 && back > 0)) {
    return 0;
  }
  const double weight = forth * back / (forth + back), apart = log(back / forth);
  for (size_t s = 0; s < TERMS; s++) {
    const double first = own->terms[a * TERMS + s] - own->terms[b * TERMS + s];
    right[s] += weight * first * apart;
    for (size_t t = 0; t < TERMS; t++) {
      normal[s * TERMS + t] += weight * first * (own->terms[a * TERMS + t] - own->terms[b * TERMS + t]);
    }
  }
  return weight;
}

/* Multiplies the flux by exp(p . terms) and scales it to mean 1 over the cells that take part. */
static void apply_step(fit *own, size_t cells, const double step[TERMS]) {
  double sum = 0, lit = 0;
  for (size_t j = 0; j < cells; j++) {
    double terms[TERMS], power = 0;
    fill_terms(own->partition, j, terms);
    for (int t = 0; t < TERMS; t++) {
      power += step[t] * terms[t];
    }
    own->flux[j] = own->dark[j] ? 0 : own->flux[j] * (float)exp(power);
    sum += (double)own->flux[j];
    lit += !own->dark[j];
  }
  for (size_t j = 0; j < cells && sum > 0; j++) {
    own->flux[j] *= (float)(lit / sum);
  }
}

static void take_step(fit *own, float *const *columns, size_t cells) {
  double normal[TERMS * TERMS] = {0}, right[TERMS] = {0}, weights = 0;
  sum_terms(own, cells);
  sum_exchange(own, columns, cells);
  for (size_t a = 0; a < (size_t)own->partition->count; a++) {
    for (size_t b = 0; b < a; b++) {
      weights += add_pair(own, a, b, normal, right);
    }
  }
  for (size_t t = 0; t < TERMS; t++) {
    normal[t * TERMS + t] += PULL * weights;
  }
  if (weights > 0 && LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', TERMS, 1, normal, TERMS, right, 1) == 0) {
    apply_step(own, cells, right);
  }
}

clt_status clt_fit_flux(const clt_partition *partition, float *const *columns, const unsigned char *dark, float *flux,
                        clt_error *error) {
  const size_t cells = (size_t)partition->width * (size_t)partition->height, count = (size_t)partition->count;
  fit own = {.partition = partition,
             .dark = dark,
             .flux = flux,
             .exchange = clt_alloc(count * count, sizeof(double)),
             .terms = clt_alloc(count, TERMS * sizeof(double)),
             .flux_sum = clt_alloc(count, sizeof(double))};
  clt_status status = CLT_OK;
  if (own.exchange == NULL || own.terms == NULL || own.flux_sum == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for the exchange of %zu blocks", count);
  }
  for (size_t j = 0; j < cells; j++) {
    flux[j] = dark[j] ? 0 : 1;
  }
  for (int step = 0; status == CLT_OK && step < STEPS; step++) {
    take_step(&own, columns, cells);
  }
  free(own.exchange);
  free(own.terms);
  free(own.flux_sum);
  return status;
}
