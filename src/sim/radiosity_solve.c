#include "sim/radiosity_solve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { ITERATIONS_MAX = 300, CHUNK = 2048 };

bool clt_radiosity_system_init(clt_radiosity_system *system, const clt_hierarchy *hierarchy) {
  size_t count = clt_hierarchy_measure(hierarchy).elements;
  system->hierarchy = hierarchy;
  system->count = count;
  system->scale = clt_alloc(7 * count + clt_hierarchy_work(hierarchy), sizeof *system->scale);
  if (system->scale == NULL) {
    return false;
  }
  clt_lanes **vectors[] = {&system->source, &system->bounced, &system->residual,
                           &system->step,   &system->image,   &system->scaled};
  for (size_t k = 0; k < sizeof vectors / sizeof vectors[0]; k++) {
    *vectors[k] = system->scale + (k + 1) * count;
  }
  system->work = system->scale + 7 * count;
  return true;
}

void clt_radiosity_system_finish(clt_radiosity_system *system) {
  free(system->scale);
  *system = (clt_radiosity_system){0};
}

typedef struct sums {
  double of[CLT_LANES];
} sums;

/* <a, b> of each lane: summed in chunks, whose order does not depend on the threads. */
static sums dot(size_t count, const clt_lanes *a, const clt_lanes *b) {
  enum { CHUNKS_MAX = 1024 };
  size_t chunk = count / CHUNKS_MAX + 1 > CHUNK ? count / CHUNKS_MAX + 1 : CHUNK;
  size_t chunks = (count + chunk - 1) / chunk;
  sums part[CHUNKS_MAX], total = {{0}};
#pragma omp parallel for schedule(static)
  for (size_t k = 0; k < chunks; k++) {
    size_t end = (k + 1) * chunk < count ? (k + 1) * chunk : count;
    part[k] = (sums){{0}};
    for (size_t e = k * chunk; e < end; e++) {
      for (int lane = 0; lane < CLT_LANES; lane++) {
        part[k].of[lane] += (double)a[e][lane] * (double)b[e][lane];
      }
    }
  }
  for (size_t k = 0; k < chunks; k++) {
    for (int lane = 0; lane < CLT_LANES; lane++) {
      total.of[lane] += part[k].of[lane];
    }
  }
  return total;
}

/* out = K in; out is not in. */
static void exchange(clt_radiosity_system *system, const clt_lanes *in, clt_lanes *out) {
#pragma omp parallel for schedule(static)
  for (size_t e = 0; e < system->count; e++) {
    system->scaled[e] = system->scale[e] * in[e];
  }
  clt_hierarchy_product(system->hierarchy, system->scaled, out, system->work);
#pragma omp parallel for schedule(static)
  for (size_t e = 0; e < system->count; e++) {
    out[e] *= system->scale[e];
  }
}

/* d += alpha p, r -= alpha (p - q), with q = K p. */
static void move(clt_radiosity_system *system, clt_lanes alpha) {
#pragma omp parallel for schedule(static)
  for (size_t e = 0; e < system->count; e++) {
    system->bounced[e] += alpha * system->step[e];
    system->residual[e] -= alpha * (system->step[e] - system->image[e]);
  }
}

/* p = r + beta p */
static void turn(clt_radiosity_system *system, clt_lanes beta) {
#pragma omp parallel for schedule(static)
  for (size_t e = 0; e < system->count; e++) {
    system->step[e] = system->residual[e] + beta * system->step[e];
  }
}

/* The lanes that are not yet solved. */
static bool unsolved(const sums *rho, const sums *target, bool goes_on[CLT_LANES]) {
  bool any = false;
  for (int lane = 0; lane < CLT_LANES; lane++) {
    goes_on[lane] = goes_on[lane] && rho->of[lane] > target->of[lane];
    any = any || goes_on[lane];
  }
  return any;
}

/* a / b in the lanes that go on, 0 in the others; one whose b is no longer positive stops. */
static clt_lanes ratios(const sums *a, const sums *b, bool goes_on[CLT_LANES]) {
  clt_lanes ratio = {0};
  for (int lane = 0; lane < CLT_LANES; lane++) {
    goes_on[lane] = goes_on[lane] && b->of[lane] > 0.0;
    ratio[lane] = goes_on[lane] ? (float)(a->of[lane] / b->of[lane]) : 0.0f;
  }
  return ratio;
}

void clt_radiosity_solve(clt_radiosity_system *system, double tolerance) {
  size_t count = system->count;
  bool goes_on[CLT_LANES] = {true, true, true, true};
  sums target = dot(count, system->source, system->source);
  for (int lane = 0; lane < CLT_LANES; lane++) {
    target.of[lane] *= tolerance * tolerance;
  }
  memset(system->bounced, 0, count * sizeof *system->bounced);
  exchange(system, system->source, system->residual);
  memcpy(system->step, system->residual, count * sizeof *system->step);
  sums rho = dot(count, system->residual, system->residual);
  system->iterations = 0;
  while (unsolved(&rho, &target, goes_on) && system->iterations < ITERATIONS_MAX) {
    exchange(system, system->step, system->image);
    sums curvature = dot(count, system->step, system->step), taken = dot(count, system->step, system->image);
    for (int lane = 0; lane < CLT_LANES; lane++) {
      curvature.of[lane] -= taken.of[lane];
    }
    move(system, ratios(&rho, &curvature, goes_on));
    sums next = dot(count, system->residual, system->residual);
    turn(system, ratios(&next, &rho, goes_on));
    rho = next;
    system->iterations++;
  }
}
