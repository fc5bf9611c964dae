#include "sim/exchange.h"

#include <stdlib.h>

#include "base/memory.h"
#include "sim/formfactor.h"
#include "sim/sides.h"

/* What may pass between a pair of surfaces. */
enum sight { HIDDEN, OPEN, PERHAPS_PARTED };

typedef struct sights {
  clt_sides *surfaces, *elements;
  unsigned char *pairs; /* of surfaces: what may pass between them */
} sights;

static void finish_sights(sights *seen) {
  clt_sides_destroy(seen->surfaces);
  clt_sides_destroy(seen->elements);
  free(seen->pairs);
}

static enum sight surfaces_sight(const sights *seen, int a, int b) {
  if (a == b || !clt_sides_in_front(seen->surfaces, a, b) || !clt_sides_in_front(seen->surfaces, b, a)) {
    return HIDDEN;
  }
  return clt_sides_may_be_parted(seen->surfaces, a, b, a, b) ? PERHAPS_PARTED : OPEN;
}

static clt_status find_sights(const clt_parts *parts, sights *seen, clt_error *error) {
  int count = parts->surface_count;
  seen->pairs = clt_alloc((size_t)count * (size_t)count, 1);
  if (seen->pairs == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for what stands between %d surfaces", count);
  }
  clt_status status = clt_sides_create(parts->surfaces, count, parts->surfaces, count, &seen->surfaces, error);
  if (status == CLT_OK) {
    status = clt_sides_create(parts->surfaces, count, parts->elements, parts->count, &seen->elements, error);
  }
  if (status != CLT_OK) {
    return status;
  }
#pragma omp parallel for schedule(dynamic, 16)
  for (int a = 0; a < count; a++) {
    for (int b = 0; b < count; b++) {
      seen->pairs[(size_t)a * (size_t)count + (size_t)b] = (unsigned char)surfaces_sight(seen, a, b);
    }
  }
  return CLT_OK;
}

/* Parts of surfaces are in sight of each other where the surfaces are, and often where those are not wholly so. */
static enum sight elements_sight(const clt_parts *parts, const sights *seen, int i, int j) {
  int a = parts->surface[i], b = parts->surface[j];
  enum sight found = (enum sight)seen->pairs[(size_t)a * (size_t)parts->surface_count + (size_t)b];
  if (found == HIDDEN || !clt_sides_in_front(seen->elements, i, b) || !clt_sides_in_front(seen->elements, j, a)) {
    return HIDDEN;
  }
  return found == PERHAPS_PARTED && !clt_sides_may_be_parted(seen->elements, i, j, a, b) ? OPEN : found;
}

static double fraction(double x) {
  return x - floor(x);
}

/* Segments end at points of a set that covers both evenly (Roberts' R4 sequence), begun elsewhere for every pair so
 * that the pairs' errors do not add up. */
double clt_exchange_visible(const clt_parts *parts, int i, int j) {
  const double step[4] = {0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101};
  const clt_rectangle *a = &parts->elements[i], *b = &parts->elements[j];
  double begin = fraction(0.7548776662466927 * i + 0.5698402909980532 * j);
  clt_vector from[CLT_SEGMENTS], to[CLT_SEGMENTS];
  for (int k = 0; k < CLT_SEGMENTS; k++) {
    double at[4];
    for (int d = 0; d < 4; d++) {
      at[d] = fraction((d + 1) * begin + k * step[d]);
    }
    from[k] = clt_rectangle_point(a, at[0], at[1]);
    to[k] = clt_rectangle_point(b, at[2], at[3]);
  }
  int open = clt_visibility_open(parts->visibility, from, to, parts->surface[i], parts->surface[j]);
  return open / (double)CLT_SEGMENTS;
}

static void fill(const clt_parts *parts, const sights *seen, double *exchange) {
#pragma omp parallel for schedule(dynamic, 16)
  for (int j = parts->count - 1; j >= 0; j--) {
    double *column = &exchange[(size_t)j * (size_t)parts->count];
    for (int i = 0; i < j; i++) {
      const clt_rectangle *a = &parts->elements[i], *b = &parts->elements[j];
      enum sight sight = elements_sight(parts, seen, i, j);
      double visible = sight == HIDDEN ? 0.0 : sight == OPEN ? 1.0 : clt_exchange_visible(parts, i, j);
      column[i] = visible > 0.0 ? visible * clt_formfactor_exchange(a, b) : 0.0;
    }
  }
}

/* Direction number `number` of a cosine-distributed set (Hammersley points), turned by `turn` of a full circle. */
static clt_vector hemisphere(const clt_rectangle *of, int number, int count, double turn) {
  double reversed = 0.0, digit = 0.5;
  for (int bits = number; bits > 0; bits >>= 1, digit *= 0.5) {
    reversed += digit * (bits & 1);
  }
  double squared = (number + 0.5) / count, angle = 2.0 * M_PI * (reversed + turn), radius = sqrt(squared);
  clt_vector across =
      vec_along(vec_scale(sqrt(1.0 - squared), of->normal), radius * cos(angle), vec_unit(of->u), 0.0, of->u);
  return vec_along(across, radius * sin(angle), vec_cross(of->normal, vec_unit(of->u)), 0.0, of->u);
}

/* Asks one ray of each element before the next, so that an open room is known at once. */
bool clt_exchange_closed(const clt_parts *parts) {
  enum { RAYS = 64, ASKED_MAX = 8192 };
  const double golden = 0.6180339887498949;
  const int stride = 1 + (parts->count - 1) / ASKED_MAX;
  bool closed = true;
  for (int ray = 0; ray < RAYS && closed; ray++) {
#pragma omp parallel for schedule(static) reduction(&& : closed)
    for (int k = 0; k < parts->count; k += stride) {
      const clt_rectangle *element = &parts->elements[k];
      clt_vector direction = hemisphere(element, ray, RAYS, golden * k);
      clt_vector from = clt_rectangle_centre(element);
      closed = closed && clt_visibility_first_hit(parts->visibility, from, direction, parts->surface[k]).front;
    }
  }
  return closed;
}

/* sums_i = scale_i (H scale)_i: the row sums of X H X. */
static void scaled_sums(const double *exchange, int count, const double *scale, double *sums) {
  for (int j = 0; j < count; j++) {
    sums[j] = 0.0;
  }
  for (int j = 0; j < count; j++) {
    const double *column = &exchange[(size_t)j * (size_t)count];
    double sum = 0.0;
    for (int i = 0; i < j; i++) {
      sum += column[i] * scale[i];
      sums[i] += column[i] * scale[j];
    }
    sums[j] += sum;
  }
  for (int j = 0; j < count; j++) {
    sums[j] *= scale[j];
  }
}

/* In an open room some light leaves: a row is only kept from sending more than all. X_i = min(1, area_i / sum_i) does
 * that in one pass, since every X_j <= 1. */
static void limit(const clt_parts *parts, const double *sums, double *scale) {
  for (int i = 0; i < parts->count; i++) {
    scale[i] = fmin(1.0, clt_rectangle_area(&parts->elements[i]) / sums[i]);
  }
}

/* In a closed room every row sum is known to be the area exactly, and what H misses is the error of quadrature and of
 * sampled visibility. X H X with a positive diagonal X that has those sums is unique where it exists (Sinkhorn and
 * Knopp 1967): it keeps H symmetric, so reciprocity holds to the last digit, keeps zeros where nothing is exchanged,
 * and moves H by no more than that error. sums comes as the row sums of H. */
static void conserve(const clt_parts *parts, const double *exchange, double *sums, double *scale) {
  enum { SWEEPS_MAX = 500 };
  double off = 1.0;
  for (int sweep = 0; sweep < SWEEPS_MAX && off > 1e-13; sweep++) {
    off = 0.0;
    for (int i = 0; i < parts->count; i++) {
      double wanted = clt_rectangle_area(&parts->elements[i]);
      if (sums[i] > 0.0) {
        scale[i] *= sqrt(wanted / sums[i]);
        off = fmax(off, fabs(sums[i] / wanted - 1.0));
      }
    }
    scaled_sums(exchange, parts->count, scale, sums);
  }
}

/* scale, sums: count values each. */
static void balance(const clt_parts *parts, double *exchange, double *scale, double *sums) {
  for (int i = 0; i < parts->count; i++) {
    scale[i] = 1.0;
  }
  scaled_sums(exchange, parts->count, scale, sums);
  if (clt_exchange_closed(parts)) {
    conserve(parts, exchange, sums, scale);
  } else {
    limit(parts, sums, scale);
  }
#pragma omp parallel for schedule(dynamic, 16)
  for (int j = 0; j < parts->count; j++) {
    double *column = &exchange[(size_t)j * (size_t)parts->count];
    for (int i = 0; i < j; i++) {
      column[i] *= scale[i] * scale[j];
    }
  }
}

clt_status clt_exchange_compute(const clt_parts *parts, double *exchange, clt_error *error) {
  size_t count = (size_t)parts->count;
  double *sums = clt_alloc(2 * count, sizeof *sums);
  sights seen = {NULL, NULL, NULL};
  clt_status status =
      sums != NULL ? find_sights(parts, &seen, error)
                   : clt_fail(error, CLT_FAILED, "out of memory for the exchange of light between %zu elements", count);
  if (status == CLT_OK) {
    fill(parts, &seen, exchange);
    balance(parts, exchange, sums, sums + count);
  }
  finish_sights(&seen);
  free(sums);
  return status;
}

double clt_exchange_between(const double *exchange, int count, int i, int j) {
  int row = i < j ? i : j, column = i < j ? j : i;
  return i == j ? 0.0 : exchange[(size_t)column * (size_t)count + (size_t)row];
}
