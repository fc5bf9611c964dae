/* Where A = I - F T^-1 is what bounces do: the exact F, and signs that the scene is not made of flat diffuse patches.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "analysis/interreflection.h"
#include "analysis/lit_inverse.h"
#include "base/order.h"

static const double SPREAD_LIMIT = 0.01, RECIPROCITY_LIMIT = 0.1;

static clt_status take_reciprocals(const clt_lit_inverse *inverse, double *first_bounce, clt_error *error) {
  for (size_t i = 0; i < inverse->count; i++) {
    double diagonal = inverse->entries[i * inverse->count + i];
    if (!(diagonal > 0) || !isfinite(diagonal)) {
      return clt_fail(error, CLT_BAD_INPUT, "(T^-1)_ii of cell %zu is %g; T is too noisy there", inverse->cell[i],
                      diagonal);
    }
    first_bounce[inverse->cell[i]] = 1 / diagonal;
  }
  return CLT_OK;
}

clt_status clt_exact_first_bounce(const clt_transport *transport, int channel, const unsigned char *lit,
                                  double *first_bounce, clt_error *error) {
  clt_lit_inverse inverse = {0};
  clt_status status = clt_lit_inverse_init(&inverse, transport, channel, lit, error);
  if (status == CLT_OK) {
    status = take_reciprocals(&inverse, first_bounce, error);
  }
  clt_lit_inverse_finish(&inverse);
  if (status != CLT_OK) {
    clt_fail_within(error, "the exact first bounce cannot be had, take F = diag(T): ");
  }
  return status;
}

/* -median of z_i (R z)_i over the lit cells of a channel, z a checkerboard of +1 and -1, R = T diag(T)^-1 - I. What R
 * carries smoothly cancels against the signs; what stays near its cell is weighed with -1 by the four neighbours. The
 * median leaves out folds, where surfaces meet and cells do light their neighbours. */
static double channel_spread(clt_interreflection *op, int c) {
  size_t width = (size_t)op->info.width, cells = op->info.cells, count = 0;
  const unsigned char *lit = clt_certificate_lit(op->certificate, c);
  const double *diagonal = clt_certificate_first_bounce(op->certificate, c);
  for (size_t i = 0; i < cells; i++) {
    double sign = (i % width + i / width) % 2 ? -1 : 1;
    op->drive[i] = lit[i] ? sign / diagonal[i] : 0;
  }
  clt_transport_apply(op->transport, c, op->drive, op->seen);
  for (size_t i = 0; i < cells; i++) {
    double sign = (i % width + i / width) % 2 ? -1 : 1;
    if (lit[i]) {
      op->seen[count++] = 1 - sign * op->seen[i];
    }
  }
  clt_sort_doubles(op->seen, count);
  return count > 0 ? op->seen[count / 2] : 0;
}

void clt_judge_exactness(clt_interreflection *op) {
  clt_interreflection_info *info = &op->info;
  for (int c = 0; c < info->channels; c++) {
    double spread = channel_spread(op, c);
    info->spread = fabs(spread) > fabs(info->spread) ? spread : info->spread;
  }
  info->inexact = info->spread > SPREAD_LIMIT || info->reciprocity > RECIPROCITY_LIMIT;
  if (info->spread > SPREAD_LIMIT) {
    snprintf(
        info->why, sizeof info->why,
        "%.2g of a cell's light goes to the cells beside it (defocus, subsurface, a shifted grid; limit %g), which "
        "A_ii = 0 leaves out",
        info->spread, SPREAD_LIMIT);
  } else if (info->inexact) {
    snprintf(
        info->why, sizeof info->why,
        "T is not reciprocal (defect %.2g, limit %g): gloss or noise, and bounces are exact for diffuse light only",
        info->reciprocity, RECIPROCITY_LIMIT);
  }
}
