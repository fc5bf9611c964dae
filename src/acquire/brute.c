/* Brute force: one cell at a time, all channels at once; the observation less the black is the column. */
#include <math.h>
#include <stdlib.h>

#include "acquire/session.h"
#include "base/memory.h"

/* The black's error counts N times in a row, so that it is worth a thirtieth of all the patterns. */
static int repeats_of_black(size_t cells) {
  size_t share = cells / 32;
  return share < CLT_REPEATS_DEFAULT ? CLT_REPEATS_DEFAULT : share > CLT_REPEATS_MAX ? CLT_REPEATS_MAX : (int)share;
}

static long count_columns(const clt_session *session) {
  return (long)session->cells;
}

/* The noise of a row of one channel. */
typedef struct row_noise {
  double sum;     /* of the variances of its entries */
  double largest; /* one of them: nearly always the cell's own light, whose photons are noisy */
  size_t column;  /* where that is */
} row_noise;

static void take_column(const clt_session *session, size_t j, clt_transport *transport, row_noise *noise) {
  size_t cells = session->cells;
  for (int c = 0; c < session->info.channels; c++) {
    float *entries = clt_transport_entries(transport, c);
    for (size_t i = 0; i < cells; i++) {
      size_t at = (size_t)c * cells + i;
      double variance = (double)session->deviation.data[at] * session->deviation.data[at];
      if (isfinite(variance)) {
        entries[i * cells + j] = session->seen.data[at] - session->black.data[at];
      }
      noise[at].sum += variance;
      if (variance > noise[at].largest) {
        noise[at].largest = variance;
        noise[at].column = j;
      }
    }
  }
}

/* Makes a row of N entries add up to its flood. An error beta of the black is in all entries of a row and shifts an
 * appearance by N beta mean(x), while the flood shows N beta at once (NUMERICS section 3); what the photons of the own
 * light got wrong shows there as well. With entry variances v_j and black variance b the missing light is shared by
 *   (v_j + N b) / (sum v + N^2 b),
 * where the v_j but the largest are taken as alike. */
static void match_row(float *row, size_t cells, double flood, double black_variance, const row_noise *noise) {
  double missing = flood, n = (double)cells, whole = noise->sum + n * n * black_variance;
  for (size_t j = 0; j < cells; j++) {
    missing -= row[j];
  }
  double share = whole > 0 && cells > 1 ? (noise->largest + n * black_variance) / whole : 1 / n;
  double rest = cells > 1 ? (1 - share) / (n - 1) : 0;
  for (size_t j = 0; j < cells; j++) {
    row[j] += (float)(missing * (j == noise->column ? share : rest));
  }
}

static void match_flood(const clt_session *session, clt_transport *transport, const row_noise *noise) {
  size_t cells = session->cells;
  for (int c = 0; c < session->info.channels; c++) {
    float *entries = clt_transport_entries(transport, c);
    for (size_t i = 0; i < cells; i++) {
      size_t at = (size_t)c * cells + i;
      if (isfinite(session->flood_variance.data[at]) && isfinite(noise[at].sum)) {
        match_row(entries + i * cells, cells, session->flood.data[at], session->black_variance.data[at], &noise[at]);
      }
    }
  }
}

static clt_status take_columns(clt_session *session, clt_transport *transport, row_noise *noise, clt_error *error) {
  size_t cells = session->cells;
  clt_status status = CLT_OK;
  clt_session_fill(session, 0);
  for (size_t j = 0; status == CLT_OK && j < cells; j++) {
    for (int c = 0; c < session->info.channels; c++) {
      session->drive.data[(size_t)c * cells + j] = 1;
    }
    status = clt_session_observe(session, "columns", error);
    if (status == CLT_OK) {
      take_column(session, j, transport, noise);
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
  row_noise *noise = clt_alloc((size_t)info->channels * cells, sizeof *noise);
  clt_status status = noise != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for %zu rows", cells);
  if (status == CLT_OK) {
    status = clt_transport_create_dense(info->width, info->height, info->channels, cells, &transport, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_keep_sigma(transport, error);
  }
  if (status == CLT_OK) {
    status = take_columns(session, transport, noise, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    free(noise);
    return status;
  }
  match_flood(session, transport, noise);
  for (size_t at = 0; at < (size_t)info->channels * cells; at++) {
    float *sigma = clt_transport_sigma_values(transport, (int)(at / cells));
    sigma[at % cells] = (float)sqrt(noise[at].sum / (double)cells);
  }
  free(noise);
  *out = transport;
  return CLT_OK;
}

static double expected_error(const clt_session *session) {
  (void)session;
  return 0.003;
}

const clt_scheme clt_scheme_brute = {"brute", repeats_of_black, count_columns, expected_error, false, measure_brute};
