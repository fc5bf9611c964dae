/* Surfaces that changed colour: what became of their reflectance, and the light of the room as it is now.
 *
 * With D = diag(K_new / K_old) the repainted room has F_new = D F and A_new = D A, so its light is l = D (F x + A l).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "analysis/interreflection.h"
#include "analysis/krylov.h"
#include "base/memory.h"
#include "base/order.h"

static const double LEAST_ARRIVING = 1e-3; /* of the 90th percentile: less says nothing of the surface */
static const double NEGATIVE_SHARE = 1e-2; /* of the light: more than noise in T makes */

struct clt_repainted {
  clt_interreflection *op;
  double *ratio;             /* channels x cells, 1 at dark cells */
  double *wanted, *v, *load; /* cells values each: D F x, the unknown, F^-1 v */
  clt_krylov krylov;
  int channel;
};

/* The 90th percentile of the lit cells' values of a channel. */
static double bright(const double *values, const unsigned char *lit, size_t cells, double *scratch) {
  size_t count = 0;
  for (size_t i = 0; i < cells; i++) {
    if (lit[i]) {
      scratch[count++] = values[i];
    }
  }
  clt_sort_doubles(scratch, count);
  return count > 0 ? scratch[(size_t)(0.9 * (double)(count - 1))] : 0;
}

/* ratio = picture / (F x + A picture); op->seen holds T y = picture up to the solve's residual. */
static size_t divide(clt_interreflection *op, const double *drive, const double *picture, double *ratio) {
  size_t cells = op->info.cells, undetermined = 0;
  for (int c = 0; c < op->info.channels; c++) {
    size_t first = (size_t)c * cells;
    const unsigned char *lit = clt_certificate_lit(op->certificate, c);
    double *arriving = op->seen + first;
    for (size_t i = 0; i < cells; i++) {
      arriving[i] += op->first_bounce[first + i] * (drive[first + i] - op->drive[first + i]);
    }
    double least = LEAST_ARRIVING * bright(arriving, lit, cells, op->drive + first);
    for (size_t i = 0; i < cells; i++) {
      bool known = lit[i] && arriving[i] > least;
      ratio[first + i] = known ? fmax(picture[first + i] / arriving[i], 0) : 1;
      undetermined += !known;
    }
  }
  return undetermined;
}

clt_status clt_repaint_ratio(clt_interreflection *op, const double *drive, const double *picture, double *ratio,
                             size_t *undetermined, clt_error *error) {
  clt_status status = clt_interreflection_check(op, drive, "drive", error);
  if (status == CLT_OK) {
    status = clt_interreflection_check(op, picture, "photograph", error);
  }
  if (status == CLT_OK) {
    status = clt_interreflection_solve(op, picture, NULL, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  size_t unknown = divide(op, drive, picture, ratio);
  if (undetermined != NULL) {
    *undetermined = unknown;
  }
  return CLT_OK;
}

/* out = ((I - D) S + D) v over lit cells. */
static void apply_repainted(void *context, const double *v, double *out) {
  clt_repainted *repainted = context;
  const clt_interreflection *op = repainted->op;
  size_t first = (size_t)repainted->channel * op->info.cells;
  const double *bounce = op->first_bounce + first, *ratio = repainted->ratio + first;
  for (size_t i = 0; i < op->info.cells; i++) {
    repainted->load[i] = bounce[i] > 0 ? v[i] / bounce[i] : 0;
  }
  clt_transport_apply(op->transport, repainted->channel, repainted->load, out);
  for (size_t i = 0; i < op->info.cells; i++) {
    out[i] = bounce[i] > 0 ? (1 - ratio[i]) * out[i] + ratio[i] * v[i] : 0;
  }
}

static clt_status take_ratio(clt_repainted *repainted, const double *ratio, clt_error *error) {
  const clt_interreflection *op = repainted->op;
  for (size_t i = 0; i < clt_interreflection_values(op); i++) {
    bool used = op->first_bounce[i] > 0;
    if (used && (!(ratio[i] >= 0) || !isfinite(ratio[i]))) {
      return clt_fail(error, CLT_BAD_INPUT, "ratio %zu is %g; new over old reflectance is finite and not below 0", i,
                      ratio[i]);
    }
    repainted->ratio[i] = used ? ratio[i] : 1;
  }
  return CLT_OK;
}

clt_status clt_repainted_create(clt_interreflection *op, const double *ratio, clt_repainted **out, clt_error *error) {
  size_t cells = op->info.cells;
  clt_repainted *repainted = calloc(1, sizeof *repainted);
  if (repainted == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to repaint %zu cells", cells);
  }
  repainted->op = op;
  repainted->ratio = clt_alloc(clt_interreflection_values(op), sizeof(double));
  repainted->wanted = clt_alloc(cells, sizeof(double));
  repainted->v = clt_alloc(cells, sizeof(double));
  repainted->load = clt_alloc(cells, sizeof(double));
  repainted->krylov = (clt_krylov){.apply = apply_repainted, .context = repainted, .count = cells};
  repainted->krylov.basis = clt_alloc(CLT_KRYLOV_VECTORS * cells, sizeof(double));
  clt_status status = CLT_OK;
  if (!repainted->ratio || !repainted->wanted || !repainted->v || !repainted->load || !repainted->krylov.basis) {
    status = clt_fail(error, CLT_FAILED, "not enough memory to repaint %zu cells", cells);
  }
  if (status == CLT_OK) {
    status = take_ratio(repainted, ratio, error);
  }
  if (status != CLT_OK) {
    clt_repainted_destroy(repainted);
    return status;
  }
  *out = repainted;
  return CLT_OK;
}

void clt_repainted_destroy(clt_repainted *repainted) {
  if (repainted == NULL) {
    return;
  }
  free(repainted->ratio);
  free(repainted->wanted);
  free(repainted->v);
  free(repainted->load);
  free(repainted->krylov.basis);
  free(repainted);
}

static clt_status check_light(const double *light, size_t cells, clt_error *error) {
  double below = 0, whole = 0;
  for (size_t i = 0; i < cells; i++) {
    below += light[i] < 0 ? -light[i] : 0;
    whole += fabs(light[i]);
  }
  return below <= NEGATIVE_SHARE * whole
             ? CLT_OK
             : clt_fail(
                   error, CLT_FAILED,
                   "the repainted room has no light that settles: with these ratios its surfaces would reflect more "
                   "than arrives; check them, and that F is exact");
}

static clt_status apply_channel(clt_repainted *repainted, int c, const double *drive, double *light, clt_error *error) {
  clt_interreflection *op = repainted->op;
  const double *bounce = op->first_bounce + (size_t)c * op->info.cells;
  const double *ratio = repainted->ratio + (size_t)c * op->info.cells;
  repainted->channel = c;
  bool negative_drive = false;
  for (size_t i = 0; i < op->info.cells; i++) {
    repainted->v[i] = bounce[i] * drive[i];
    repainted->wanted[i] = ratio[i] * repainted->v[i];
    negative_drive = negative_drive || drive[i] < 0;
  }
  double left = clt_krylov_solve(&repainted->krylov, repainted->wanted, op->tolerance, repainted->v);
  if (!(left <= fmax(1e-4, 2 * op->tolerance))) {
    return clt_fail(
        error, CLT_FAILED,
        "the light of the repainted room was found to %.1e of it only; with these ratios its surfaces would "
        "reflect nearly all that arrives, or more",
        left);
  }
  for (size_t i = 0; i < op->info.cells; i++) {
    repainted->load[i] = bounce[i] > 0 ? repainted->v[i] / bounce[i] : 0;
  }
  clt_transport_apply(op->transport, c, repainted->load, light);
  return negative_drive ? CLT_OK : check_light(light, op->info.cells, error);
}

clt_status clt_repainted_apply(clt_repainted *repainted, const double *drive, double *light, clt_error *error) {
  size_t cells = repainted->op->info.cells;
  clt_status status = clt_interreflection_check(repainted->op, drive, "drive", error);
  for (int c = 0; c < repainted->op->info.channels && status == CLT_OK; c++) {
    status = apply_channel(repainted, c, drive + (size_t)c * cells, light + (size_t)c * cells, error);
  }
  return status;
}
