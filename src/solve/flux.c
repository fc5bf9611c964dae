/* Flux weights: the w that makes S diag(w) symmetric.
 *
 * In a Lambertian scene a_i G_ij = a_j G_ji and A = K G, so S_true = (I - A)^-1 has S_true diag(m_i / a_i) = N
 * symmetric positive definite (albedo m, area a). T = S_true Phi for the flux Phi of each cell; with F = diag(T) the
 * system's S = T F^-1 = N diag(N)^-1, so w = diag(N). No area or albedo needs to be known: symmetry S_ij w_j = S_ji w_i
 * summed over j != i says, with R = S - I and c = R' 1,
 *
 *   w_i = (R w)_i / c_i        w = Q w,  Q = diag(c)^-1 R,
 *
 * and diag(c) w is the stationary distribution of the Markov chain diag(c)^-1 R', which is reversible here. The power
 * iteration on Q alternates for ever between two facing walls and damped it needs many products where light mixes
 * slowly; GMRES on (I - Q) (1 + d) = 0 finds the fixed point in a few. */
#include <math.h>

#include "solve/method.h"

static const double FLUX_TOLERANCE = 1e-7;
static const double LEAST_WEIGHT = 1e-6; /* of the mean: what noise leaves below is not believed */
enum { FLUX_PRODUCTS = 20 };

typedef struct chain {
  clt_system *system;
  double *inverse_column; /* 1 / c_i; 0 where a cell gives no light to others: its weight stays 1 */
} chain;

/* out = (I - Q) in */
static void apply_chain(void *context, const double *in, double *out) {
  const chain *flow = context;
  clt_system_apply(flow->system, in, out);
  for (size_t i = 0; i < flow->system->cols; i++) {
    out[i] = in[i] - (out[i] - in[i]) * flow->inverse_column[i];
  }
}

static void fill_ones(const clt_system *system, double *values) {
  for (size_t i = 0; i < system->cols; i++) {
    values[i] = system->lit[i] ? 1 : 0;
  }
}

/* 1 / c with c = R' 1. Sums that are rounding or negative noise count as no interreflection. */
static void fill_columns(clt_system *system, double *inverse_column) {
  double *ones = clt_system_vector(system, CLT_GMRES_VECTORS + 1), sum = 0;
  fill_ones(system, ones);
  clt_system_apply_transposed(system, ones, inverse_column);
  for (size_t i = 0; i < system->cols; i++) {
    inverse_column[i] -= ones[i];
    sum += fmax(inverse_column[i], 0);
  }
  double least = fmax(LEAST_WEIGHT * sum / (double)system->cols, 1e-12);
  for (size_t i = 0; i < system->cols; i++) {
    inverse_column[i] = system->lit[i] && inverse_column[i] > least ? 1 / inverse_column[i] : 0;
  }
}

/* Scales w to mean 1 over lit cells and puts 1 where noise left no positive weight. */
static void normalise(const clt_system *system, double *w) {
  double sum = 0;
  size_t positive = 0;
  for (size_t i = 0; i < system->cols; i++) {
    if (system->lit[i] && w[i] > 0) {
      sum += w[i];
      positive++;
    }
  }
  double mean = positive > 0 ? sum / (double)positive : 1, total = 0;
  size_t lit = 0;
  for (size_t i = 0; i < system->cols; i++) {
    if (system->lit[i]) {
      w[i] = w[i] > LEAST_WEIGHT * mean ? w[i] / mean : 1;
      total += w[i];
      lit++;
    }
  }
  for (size_t i = 0; i < system->cols; i++) {
    w[i] = system->lit[i] ? w[i] * (double)lit / total : 0;
  }
}

/* A sign for every block of scale x scale cells, the same at every call. */
static void fill_signs(const clt_system *system, size_t width, size_t scale, double *z) {
  for (size_t i = 0; i < system->cols; i++) {
    uint64_t block = ((i / width / scale) << 32) + i % width / scale + 1;
    z[i] = !system->lit[i] ? 0 : (block * 0x9e3779b97f4a7c15u ^ block * 0xbf58476d1ce4e5b9u >> 7) >> 63 ? 1 : -1;
  }
}

/* ||(S W - (S W)') z|| / ||S W z|| for signs z over blocks of one scale; (S W)' z = W S' z. */
static double defect_at(clt_system *system, const double *w, size_t width, size_t scale) {
  double *z = clt_system_vector(system, 0), *forward = clt_system_vector(system, 1);
  double *backward = clt_system_vector(system, 2), *weighted = clt_system_vector(system, 3);
  fill_signs(system, width, scale, z);
  for (size_t i = 0; i < system->cols; i++) {
    weighted[i] = w[i] * z[i];
  }
  clt_system_apply(system, weighted, forward);
  clt_system_apply_transposed(system, z, backward);
  double difference = 0, size = 0;
  for (size_t i = 0; i < system->cols; i++) {
    double apart = forward[i] - w[i] * backward[i];
    difference += apart * apart;
    size += forward[i] * forward[i];
  }
  return size > 0 ? sqrt(difference / size) : 0;
}

/* Seen at every scale: fine signs see the noise of single entries as a product does, coarse ones what is uneven between
 * regions, which light that spreads widely hides among many small entries. */
static double reciprocity_defect(clt_system *system, const double *w) {
  clt_transport_info info = clt_transport_describe(system->transport);
  size_t width = (size_t)info.width, side = (size_t)(info.width > info.height ? info.width : info.height);
  double worst = 0;
  for (size_t scale = 1; scale < side || scale == 1; scale *= 2) {
    worst = fmax(worst, defect_at(system, w, width, scale));
  }
  return worst;
}

double clt_flux_weights(clt_system *system, double *w) {
  chain flow = {system, clt_system_vector(system, CLT_GMRES_VECTORS)};
  double *residual = clt_system_vector(system, CLT_GMRES_VECTORS + 2);
  fill_ones(system, w);
  fill_columns(system, flow.inverse_column);
  apply_chain(&flow, w, residual);
  for (size_t i = 0; i < system->cols; i++) {
    residual[i] = flow.inverse_column[i] > 0 ? -residual[i] : 0;
  }
  clt_run run = {.iteration_limit = FLUX_PRODUCTS};
  clt_gmres gmres = {.apply = apply_chain,
                     .context = &flow,
                     .count = system->cols,
                     .basis = clt_system_vector(system, 0),
                     .stride = system->stride,
                     .target = FLUX_TOLERANCE * clt_norm(system->cols, w)};
  double norm = clt_norm(system->cols, residual);
  if (norm > gmres.target) {
    clt_gmres_cycle(&gmres, &run, residual, norm, w);
  }
  normalise(system, w);
  return reciprocity_defect(system, w);
}
