/* The bounce operator A: given entry by entry, or of a transport as I - F T^-1. */
#include "analysis/bounce_operator.h"

#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "analysis/interreflection.h"
#include "analysis/lit_inverse.h"
#include "base/memory.h"

enum { POWER_STEPS = 8 };
static const double SHIFT = 0.05; /* of the power iteration, relative to the radius: parallel plates swap their light */

static clt_status apply_entries(void *context, const double *light, double *next, clt_error *error) {
  const clt_bounce_entries *of = context;
  (void)error;
  cblas_dgemv(CblasRowMajor, CblasNoTrans, (blasint)of->count, (blasint)of->count, 1, of->entries, (blasint)of->count,
              light, 1, 0, next, 1);
  return CLT_OK;
}

static clt_status take_row(void *context, size_t i, double *row, clt_error *error) {
  const clt_bounce_entries *of = context;
  (void)error;
  memcpy(row, of->entries + i * of->count, of->count * sizeof *row);
  return CLT_OK;
}

clt_bounce_operator clt_bounce_operator_of_entries(const clt_bounce_entries *entries) {
  return (clt_bounce_operator){
      .count = entries->count, .apply = apply_entries, .row = take_row, .context = (void *)entries};
}

static clt_status apply_transport(void *context, const double *light, double *next, clt_error *error) {
  return clt_interreflection_apply(context, light, next, NULL, error);
}

clt_bounce_operator clt_bounce_operator_of_transport(clt_interreflection *interreflection) {
  return (clt_bounce_operator){
      .count = clt_interreflection_values(interreflection), .apply = apply_transport, .context = interreflection};
}

/* A lit cell's row is that of I - F T_ll^-1, a dark one's that of T_dl T_ll^-1; columns of dark cells are 0. `lit` is
 * the number of the cell among the lit ones; brief has room for 2 count values. */
static void fill_lit_row(const clt_lit_inverse *inverse, size_t lit, double first_bounce, double *brief) {
  const double *of = inverse->entries + lit * inverse->count;
  for (size_t j = 0; j < inverse->count; j++) {
    brief[j] = (j == lit) - first_bounce * of[j];
  }
}

static void fill_dark_row(const clt_lit_inverse *inverse, const double *seen, double *brief) {
  blasint count = (blasint)inverse->count;
  double *known = brief + inverse->count;
  if (count == 0) {
    return;
  }
  for (size_t j = 0; j < inverse->count; j++) {
    known[j] = seen[inverse->cell[j]];
  }
  cblas_dgemv(CblasRowMajor, CblasTrans, count, count, 1, inverse->entries, count, known, 1, 0, brief, 1);
}

static clt_status fill_rows(const clt_interreflection *op, int channel, const clt_lit_inverse *inverse, double *brief,
                            double *entries, clt_error *error) {
  size_t cells = op->info.cells, lit = 0;
  clt_status status = CLT_OK;
  for (size_t i = 0; i < cells && status == CLT_OK; i++) {
    double *row = entries + i * cells;
    if (lit < inverse->count && inverse->cell[lit] == i) {
      fill_lit_row(inverse, lit++, op->first_bounce[(size_t)channel * cells + i], brief);
    } else {
      status = clt_transport_row(op->transport, channel, i, row, error);
      fill_dark_row(inverse, row, brief);
    }
    memset(row, 0, cells * sizeof *row);
    for (size_t j = 0; j < inverse->count; j++) {
      row[inverse->cell[j]] = brief[j];
    }
  }
  return status;
}

clt_status clt_interreflection_entries(clt_interreflection *op, int channel, double *entries, clt_error *error) {
  clt_lit_inverse inverse = {0};
  clt_status status =
      clt_lit_inverse_init(&inverse, op->transport, channel, clt_certificate_lit(op->certificate, channel), error);
  double *brief = clt_alloc(2 * op->info.cells, sizeof *brief);
  if (status == CLT_OK && brief == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory for the bounces of %zu cells", op->info.cells);
  }
  if (status == CLT_OK) {
    status = fill_rows(op, channel, &inverse, brief, entries, error);
  }
  free(brief);
  clt_lit_inverse_finish(&inverse);
  return status;
}

clt_status clt_bounce_check(const double *values, size_t count, clt_error *error) {
  for (size_t i = 0; i < count; i++) {
    if (!isfinite(values[i])) {
      return clt_fail(error, CLT_BAD_INPUT, "A makes light of %g at value %zu; its entries must be finite numbers",
                      values[i], i);
    }
  }
  return CLT_OK;
}

/* For A >= 0 and u > 0, max (A u)_i / u_i is ||A|| in the norm max |l_i| / u_i, and at least rho(A). */
clt_status clt_bounce_norm(const clt_bounce_operator *bounce, double *u, double *scratch, double *norm,
                           clt_error *error) {
  clt_status status = CLT_OK;
  *norm = INFINITY;
  for (size_t i = 0; i < bounce->count; i++) {
    u[i] = 1;
  }
  for (int step = 0; step < POWER_STEPS && status == CLT_OK; step++) {
    double most = 0;
    status = bounce->apply(bounce->context, u, scratch, error);
    status = status == CLT_OK ? clt_bounce_check(scratch, bounce->count, error) : status;
    for (size_t i = 0; i < bounce->count && status == CLT_OK; i++) {
      most = fmax(most, fabs(scratch[i]) / u[i]);
    }
    *norm = fmin(*norm, most);
    for (size_t i = 0; i < bounce->count && most > 0; i++) {
      u[i] = fmax(scratch[i], 0) / most + SHIFT * u[i];
    }
  }
  return status;
}
