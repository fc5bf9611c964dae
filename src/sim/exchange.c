#include "sim/exchange.h"

#include <stdlib.h>

#include "base/memory.h"
#include "sim/formfactor.h"

/* What may pass between a pair of surfaces. */
enum sight { HIDDEN, OPEN, PERHAPS_PARTED };

/* Looking for what could part each pair takes surfaces^3 steps; so many surfaces do part some, and rays tell. */
enum { CULLED_MAX = 256 };

static void find_sights(const clt_parts *parts, unsigned char *sights) {
  int count = parts->surface_count;
#pragma omp parallel for schedule(dynamic)
  for (int a = 0; a < count; a++) {
    for (int b = 0; b < count; b++) {
      enum sight found = HIDDEN;
      if (a != b && clt_rectangles_face(&parts->surfaces[a], &parts->surfaces[b])) {
        bool parted = count > CULLED_MAX || clt_rectangles_may_be_parted(parts->surfaces, count, a, b);
        found = parted ? PERHAPS_PARTED : OPEN;
      }
      sights[(size_t)a * (size_t)count + (size_t)b] = (unsigned char)found;
    }
  }
}

static double fraction(double x) {
  return x - floor(x);
}

/* The fraction of segments from a to b that nothing cuts, between points of a set that covers both evenly (Roberts' R4
 * sequence), begun elsewhere for every pair so that the pairs' errors do not add up. */
static double visible_fraction(const clt_parts *parts, int i, int j) {
  enum { SEGMENTS = 16 };
  const double step[4] = {0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101};
  const clt_rectangle *a = &parts->elements[i], *b = &parts->elements[j];
  double begin = fraction(0.7548776662466927 * i + 0.5698402909980532 * j);
  int open = 0;
  for (int k = 0; k < SEGMENTS; k++) {
    double at[4];
    for (int d = 0; d < 4; d++) {
      at[d] = fraction((d + 1) * begin + k * step[d]);
    }
    clt_vector from = clt_rectangle_point(a, at[0], at[1]);
    clt_vector to = clt_rectangle_point(b, at[2], at[3]);
    open += !clt_visibility_blocked(parts->visibility, from, to, parts->surface[i], parts->surface[j]);
  }
  return open / (double)SEGMENTS;
}

static void fill(const clt_parts *parts, const unsigned char *sights, double *exchange) {
#pragma omp parallel for schedule(dynamic, 16)
  for (int j = parts->count - 1; j >= 0; j--) {
    double *column = &exchange[(size_t)j * (size_t)parts->count];
    for (int i = 0; i < j; i++) {
      const clt_rectangle *a = &parts->elements[i], *b = &parts->elements[j];
      size_t pair = (size_t)parts->surface[i] * (size_t)parts->surface_count + (size_t)parts->surface[j];
      double visible = sights[pair] == HIDDEN ? 0.0 : sights[pair] == OPEN ? 1.0 : visible_fraction(parts, i, j);
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

/* True where rays from the middle of every element meet fronts only. Asks one ray of each element before the next, so
 * that an open room is known at once. */
static bool room_is_closed(const clt_parts *parts) {
  enum { RAYS = 64 };
  const double golden = 0.6180339887498949;
  for (int ray = 0; ray < RAYS; ray++) {
    for (int k = 0; k < parts->count; k++) {
      const clt_rectangle *element = &parts->elements[k];
      clt_vector direction = hemisphere(element, ray, RAYS, golden * k);
      clt_vector from = clt_rectangle_centre(element);
      if (!clt_visibility_first_hit(parts->visibility, from, direction, parts->surface[k]).front) {
        return false;
      }
    }
  }
  return true;
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
  if (room_is_closed(parts)) {
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
  size_t count = (size_t)parts->count, surfaces = (size_t)parts->surface_count;
  unsigned char *sights = clt_alloc(surfaces * surfaces, 1);
  double *sums = clt_alloc(2 * count, sizeof *sums);
  clt_status status = CLT_OK;
  if (!sights || !sums) {
    status = clt_fail(error, CLT_FAILED, "out of memory for the exchange of light between %zu elements", count);
  } else {
    find_sights(parts, sights);
    fill(parts, sights, exchange);
    balance(parts, exchange, sums, sums + count);
  }
  free(sights);
  free(sums);
  return status;
}

double clt_exchange_between(const double *exchange, int count, int i, int j) {
  int row = i < j ? i : j, column = i < j ? j : i;
  return i == j ? 0.0 : exchange[(size_t)column * (size_t)count + (size_t)row];
}
