/* Brute force: one cell at a time, all channels at once; the observation less the black is the column. */
#include <math.h>
#include <stdlib.h>

#include "acquire/session.h"
#include "base/memory.h"

static long count_columns(const clt_session *session) {
  return (long)session->cells;
}

/* Column j of every channel, and the variances of its entries added up for sigma. */
static void take_column(const clt_session *session, size_t j, clt_transport *transport, double *variances) {
  size_t cells = session->cells;
  for (int c = 0; c < session->info.channels; c++) {
    float *entries = clt_transport_entries(transport, c);
    for (size_t i = 0; i < cells; i++) {
      size_t at = (size_t)c * cells + i;
      double deviation = session->deviation.data[at];
      if (isfinite(deviation)) {
        entries[i * cells + j] = session->seen.data[at] - session->black.data[at];
      }
      variances[at] += deviation * deviation;
    }
  }
}

/* Flood-consistent rows: an error beta of the black is in all N entries of a row and shifts an appearance by N beta
 * mean(x), while the flood shows N beta at once. c_i = flood_i - sum_j T_ij, spread evenly over the row, takes it away
 * (NUMERICS section 3); independent noise of the entries hardly changes by it. */
static void match_flood(const clt_session *session, clt_transport *transport) {
  size_t cells = session->cells;
  for (int c = 0; c < session->info.channels; c++) {
    float *entries = clt_transport_entries(transport, c);
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < cells; i++) {
      float *row = entries + i * cells;
      double missing = session->flood.data[(size_t)c * cells + i];
      if (!isfinite(session->flood_variance.data[(size_t)c * cells + i])) {
        continue;
      }
      for (size_t j = 0; j < cells; j++) {
        missing -= row[j];
      }
      for (size_t j = 0; j < cells; j++) {
        row[j] += (float)(missing / (double)cells);
      }
    }
  }
}

static clt_status take_columns(clt_session *session, clt_transport *transport, double *variances, clt_error *error) {
  size_t cells = session->cells;
  clt_status status = CLT_OK;
  clt_session_fill(session, 0);
  for (size_t j = 0; status == CLT_OK && j < cells; j++) {
    for (int c = 0; c < session->info.channels; c++) {
      session->drive.data[(size_t)c * cells + j] = 1;
    }
    status = clt_session_observe(session, "columns", error);
    if (status == CLT_OK) {
      take_column(session, j, transport, variances);
    }
    for (int c = 0; c < session->info.channels; c++) {
      session->drive.data[(size_t)c * cells + j] = 0;
    }
  }
  return status;
}

static clt_status measure_brute(clt_session *session, clt_transport **out, clt_error *error) {
  const clt_rig_info *info = &session->info;
  size_t cells = session->cells;
  clt_transport *transport = NULL;
  double *variances = clt_alloc((size_t)info->channels * cells, sizeof *variances);
  clt_status status = variances != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for %zu rows", cells);
  if (status == CLT_OK) {
    status = clt_transport_create_dense(info->width, info->height, info->channels, cells, &transport, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_keep_sigma(transport, error);
  }
  if (status == CLT_OK) {
    status = take_columns(session, transport, variances, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    free(variances);
    return status;
  }
  match_flood(session, transport);
  for (size_t at = 0; at < (size_t)info->channels * cells; at++) {
    float *sigma = clt_transport_sigma_values(transport, (int)(at / cells));
    sigma[at % cells] = (float)sqrt(variances[at] / (double)cells);
  }
  free(variances);
  *out = transport;
  return CLT_OK;
}

const clt_scheme clt_scheme_brute = {"brute", count_columns, measure_brute};
