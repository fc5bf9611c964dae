#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"
#include "solve/method.h"

/* A cell is dark below this many standard deviations of its row, or below this share of the bright cells' F. */
static const double DARK_SIGMAS = 5, DARK_SHARE = 1e-3, BRIGHT_QUANTILE = 0.9;
static const double SHIFT = 0.05; /* of the power iteration, relative to the radius */
enum { POWER_STEPS = 6, WORTH_SHARING = 65536 /* entries that pay for waking threads */ };

struct clt_certificate {
  int channels;
  size_t rows, cols;
  clt_channel_certificate channel[CLT_CHANNELS_MAX];
  double *first_bounce, *flux; /* channels x cols */
  double *flood;               /* channels x rows: T 1 over lit cells */
  double *reflood;             /* channels x rows: S times that; 0 where T is not square */
  unsigned char *lit;
  clt_model model[CLT_CHANNELS_MAX];
};

/* The value at a quantile of those values that `chosen` marks (NULL: the positive finite ones), between the two
 * nearest; 0 where there are none. */
static double quantile(const double *values, const unsigned char *chosen, size_t count, double share, double *scratch) {
  size_t kept = 0;
  for (size_t i = 0; i < count; i++) {
    if (chosen != NULL ? chosen[i] : isfinite(values[i]) && values[i] > 0) {
      scratch[kept++] = values[i];
    }
  }
  if (kept == 0) {
    return 0;
  }
  clt_sort_doubles(scratch, kept);
  double position = share * (double)(kept - 1);
  size_t below = (size_t)position, above = below + 1 < kept ? below + 1 : below;
  return scratch[below] + (position - (double)below) * (scratch[above] - scratch[below]);
}

/* F; where the two spaces differ, a column's sum takes its place as the scale of the drive. */
static void measure_first_bounce(clt_system *system, int channel, double *first_bounce) {
  if (system->square) {
    clt_transport_diagonal(system->transport, channel, first_bounce);
    return;
  }
  for (size_t i = 0; i < system->rows; i++) {
    system->seen[i] = 1;
  }
  clt_transport_apply_transposed(system->transport, channel, system->seen, first_bounce);
}

static size_t find_lit(const clt_system *system, int channel, const double *first_bounce, unsigned char *lit,
                       double *scratch) {
  const float *sigma = system->square ? clt_transport_sigma(system->transport, channel) : NULL;
  double dark = DARK_SHARE * quantile(first_bounce, NULL, system->cols, BRIGHT_QUANTILE, scratch);
  size_t count = 0;
  for (size_t i = 0; i < system->cols; i++) {
    double least = sigma != NULL ? fmax(dark, DARK_SIGMAS * (double)sigma[i]) : dark;
    lit[i] = isfinite(first_bounce[i]) && first_bounce[i] > least;
    count += lit[i];
  }
  return count;
}

/* y = max(R x, 0): what products with T give of any storage. Noise averages out over a row. */
static void apply_averaged(clt_system *system, const double *x, double *y) {
  clt_system_apply(system, x, y);
  for (size_t i = 0; i < system->cols; i++) {
    y[i] = fmax(y[i] - x[i], 0);
  }
}

/* y = max(R, 0) x for x >= 0, entry by entry of a dense T. */
static void apply_clipped(clt_system *system, const double *x, double *y) {
  const float *entries = clt_transport_entries(system->transport, system->channel);
  for (size_t j = 0; j < system->cols; j++) {
    system->drive[j] = x[j] * system->scale[j];
  }
  const double *drive = system->drive;
  size_t cols = system->cols;
#pragma omp parallel for schedule(static) if (cols * cols >= WORTH_SHARING)
  for (size_t i = 0; i < cols; i++) {
    const float *row = entries + i * cols;
    double sum = 0;
    if (system->lit[i]) {
#pragma omp simd reduction(+ : sum)
      for (size_t j = 0; j < cols; j++) {
        sum += (row[j] > 0 ? (double)row[j] : 0) * drive[j];
      }
      sum = fmax(sum - (double)row[i] * drive[i], 0);
    }
    y[i] = sum;
  }
}

/* The least and the greatest of y_i / x_i over the support of x. */
static void ratios(const clt_system *system, const double *x, const double *y, double *low, double *high) {
  *low = INFINITY;
  *high = 0;
  for (size_t i = 0; i < system->cols; i++) {
    if (x[i] > 0) {
      *low = fmin(*low, y[i] / x[i]);
      *high = fmax(*high, y[i] / x[i]);
    }
  }
  *low = fmin(*low, *high); /* 0 where the support is empty */
}

/* Collatz-Wielandt: for R >= 0 and x > 0, min (Rx)_i / x_i <= rho(R) <= max (Rx)_i / x_i. Each step x <- R x + s x
 * tightens both; the small shift s keeps x positive. The lower bound holds for any support of x too, since rho(R) is at
 * least that of a principal submatrix; the last two products use the brightest part of x, because one cell that
 * receives no light would make the bound 0. */
static void bound_radius(clt_system *system, void (*apply)(clt_system *, const double *, double *), double *radius_low,
                         double *radius_high) {
  static const double PARTS[] = {0.1, 0.5};
  double *x = clt_system_vector(system, 0), *y = clt_system_vector(system, 1), low, high, top = 1;
  *radius_low = 0;
  *radius_high = INFINITY;
  for (size_t i = 0; i < system->cols; i++) {
    x[i] = system->lit[i] ? 1 : 0;
  }
  for (int step = 0; step < POWER_STEPS; step++) {
    apply(system, x, y);
    ratios(system, x, y, &low, &high);
    *radius_low = fmax(*radius_low, low);
    *radius_high = fmin(*radius_high, high);
    if (high == 0) {
      return;
    }
    top = 0;
    for (size_t i = 0; i < system->cols; i++) {
      x[i] = y[i] / high + SHIFT * x[i];
      top = fmax(top, x[i]);
    }
  }
  for (size_t part = 0; part < sizeof PARTS / sizeof PARTS[0]; part++) {
    for (size_t i = 0; i < system->cols; i++) {
      x[i] = x[i] >= PARTS[part] * top ? x[i] : 0;
    }
    apply(system, x, y);
    ratios(system, x, y, &low, &high);
    *radius_low = fmax(*radius_low, low);
  }
}

static bool has_negative_entry(const clt_system *system) {
  const float *entries = clt_transport_entries(system->transport, system->channel);
  for (size_t i = 0; entries != NULL && i < system->rows * system->cols; i++) {
    if (entries[i] < 0 && system->lit[i / system->cols] && system->lit[i % system->cols]) {
      return true;
    }
  }
  return false;
}

/* Where R has negative entries (noise) a dense T is bounded from above with them clipped to 0, and from below with them
 * kept: clipping only one sign of the noise adds up over a row and would refuse Jacobi where it converges. Other
 * storage has only the products, and with them both bounds of R as it stands. */
static void certify_radius(clt_system *system, clt_channel_certificate *channel) {
  bound_radius(system, apply_averaged, &channel->radius_low, &channel->radius_high);
  if (has_negative_entry(system)) {
    double low;
    bound_radius(system, apply_clipped, &low, &channel->radius_high);
    channel->radius_low = fmin(channel->radius_low, channel->radius_high);
  }
}

/* sqrt(max row sum * max column sum) of |R|: exactly for a dense T; for other storage of R by products with 1, which
 * is the same where R has no negative entries. */
static double bound_norm(clt_system *system) {
  double *row_sums = clt_system_vector(system, 0), *column_sums = clt_system_vector(system, 1);
  double *ones = clt_system_vector(system, 2);
  const float *entries = clt_transport_entries(system->transport, system->channel);
  size_t cols = system->cols;
  for (size_t i = 0; i < cols; i++) {
    ones[i] = system->lit[i] ? 1 : 0;
  }
  if (entries == NULL) {
    clt_system_apply(system, ones, row_sums);
    clt_system_apply_transposed(system, ones, column_sums);
  } else {
    memset(column_sums, 0, cols * sizeof *column_sums);
    for (size_t i = 0; i < cols; i++) {
      row_sums[i] = 0;
      for (size_t j = 0; j < cols && system->lit[i]; j++) {
        double entry = fabs((double)entries[i * cols + j]) * system->scale[j];
        row_sums[i] += entry;
        column_sums[j] += entry;
      }
    }
  }
  double most_row = 0, most_column = 0;
  for (size_t i = 0; i < cols; i++) {
    most_row = fmax(most_row, row_sums[i] - ones[i]);
    most_column = fmax(most_column, column_sums[i] - ones[i]);
  }
  return sqrt(most_row * most_column);
}

/* flood = T 1 over lit cells. Products with the cells that take part must be numbers: a NaN in a dark row or column
 * does no harm, one among the lit entries spoils every answer. */
static clt_status check_finite(clt_system *system, int c, double *flood, clt_error *error) {
  double *ones = clt_system_vector(system, 0);
  for (size_t i = 0; i < system->cols; i++) {
    ones[i] = system->lit[i] ? system->first_bounce[i] : 0;
  }
  clt_system_apply(system, ones, flood);
  for (size_t i = 0; i < system->rows; i++) {
    if (!isfinite(flood[i])) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "row %zu of channel %d of the transport holds a value that is not a finite number; measure it "
                      "again, or set the row and its cell's column to 0",
                      i, c);
    }
  }
  return CLT_OK;
}

/* A T whose cells all send their light elsewhere (a mirror, or rows in another order than the columns) looks black on
 * its diagonal, but is not. */
static clt_status check_matched(clt_system *system, int c, const clt_channel_certificate *channel,
                                const double *first_bounce, clt_error *error) {
  double *ones = clt_system_vector(system, 0), *sums = clt_system_vector(system, 1), most = 0;
  if (!system->square || channel->lit > 0) {
    return CLT_OK;
  }
  for (size_t i = 0; i < system->rows; i++) {
    ones[i] = isfinite(first_bounce[i]) ? 1 : 0;
  }
  clt_transport_apply_transposed(system->transport, c, ones, sums);
  for (size_t j = 0; j < system->cols; j++) {
    most = fmax(most, sums[j] - (isfinite(first_bounce[j]) ? first_bounce[j] : 0));
  }
  if (most > 0 && clt_transport_sigma(system->transport, c) == NULL) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "no cell of channel %d shows its own light, but light of up to %.3g goes elsewhere: a mirror, or "
                    "rows in another order than the columns; put the rows in order, or add one of zeros to the T so "
                    "that lsmr or bounded take it",
                    c, most);
  }
  return CLT_OK;
}

static clt_status certify_channel(clt_certificate *certificate, clt_system *system, int c, clt_error *error) {
  clt_channel_certificate *channel = &certificate->channel[c];
  size_t at = (size_t)c * system->cols;
  double *first_bounce = certificate->first_bounce + at, *flux = certificate->flux + at;
  unsigned char *lit = certificate->lit + at;
  measure_first_bounce(system, c, first_bounce);
  channel->lit = find_lit(system, c, first_bounce, lit, system->drive);
  channel->dark = system->cols - channel->lit;
  channel->white = quantile(first_bounce, lit, system->cols, 0.5, system->drive);
  clt_system_select(system, c, first_bounce, lit);
  clt_status status = check_matched(system, c, channel, first_bounce, error);
  status = status == CLT_OK ? check_finite(system, c, certificate->flood + (size_t)c * system->rows, error) : status;
  if (status != CLT_OK) {
    return status;
  }
  if (!system->square) {
    for (size_t i = 0; i < system->cols; i++) {
      flux[i] = lit[i];
    }
    channel->radius_high = channel->norm_high = channel->reciprocity = INFINITY;
    return CLT_OK;
  }
  certify_radius(system, channel);
  clt_system_apply(system, certificate->flood + at, certificate->reflood + at);
  channel->norm_high = bound_norm(system);
  channel->reciprocity = clt_flux_weights(system, flux);
  clt_model_build(system, &certificate->model[c]);
  return CLT_OK;
}

clt_status clt_certify(const clt_transport *transport, clt_certificate **out, clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  clt_system system = {0};
  clt_certificate *certificate = clt_alloc(1, sizeof *certificate);
  if (certificate == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a certificate");
  }
  size_t values = (size_t)info.channels * info.cols;
  *certificate = (clt_certificate){.channels = info.channels, .rows = info.rows, .cols = info.cols};
  certificate->first_bounce = clt_alloc(values, sizeof(double));
  certificate->flux = clt_alloc(values, sizeof(double));
  certificate->flood = clt_alloc((size_t)info.channels * info.rows, sizeof(double));
  certificate->reflood = clt_alloc((size_t)info.channels * info.rows, sizeof(double));
  certificate->lit = clt_alloc(values, 1);
  clt_status status = CLT_OK;
  if (certificate->first_bounce == NULL || certificate->flux == NULL || certificate->flood == NULL ||
      certificate->reflood == NULL || certificate->lit == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory for a certificate of %zu cells", info.cols);
  }
  if (status == CLT_OK) {
    status = clt_system_init(&system, transport, false, error);
  }
  if (status == CLT_OK) {
    status = clt_system_reserve(&system, CLT_FLUX_VECTORS, error);
  }
  for (int c = 0; status == CLT_OK && c < info.channels; c++) {
    status = certify_channel(certificate, &system, c, error);
  }
  clt_system_finish(&system);
  if (status != CLT_OK) {
    clt_certificate_destroy(certificate);
    return status;
  }
  *out = certificate;
  return CLT_OK;
}

clt_status clt_certify_white(const clt_transport *transport, double *white, clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  clt_system system = {0};
  double *first_bounce = clt_alloc(info.cols, sizeof *first_bounce);
  unsigned char *lit = clt_alloc(info.cols, sizeof *lit);
  clt_status status = first_bounce != NULL && lit != NULL
                          ? clt_system_init(&system, transport, false, error)
                          : clt_fail(error, CLT_FAILED, "not enough memory for the white of %zu cells", info.cols);
  for (int c = 0; status == CLT_OK && c < info.channels; c++) {
    measure_first_bounce(&system, c, first_bounce);
    find_lit(&system, c, first_bounce, lit, system.drive);
    white[c] = quantile(first_bounce, lit, info.cols, 0.5, system.drive);
  }
  clt_system_finish(&system);
  free(first_bounce);
  free(lit);
  return status;
}

void clt_certificate_destroy(clt_certificate *certificate) {
  if (certificate == NULL) {
    return;
  }
  free(certificate->first_bounce);
  free(certificate->flux);
  free(certificate->flood);
  free(certificate->reflood);
  free(certificate->lit);
  free(certificate);
}

const clt_channel_certificate *clt_certificate_channel(const clt_certificate *certificate, int channel) {
  return &certificate->channel[channel];
}

bool clt_certificate_any_lit(const clt_certificate *certificate) {
  bool any = false;
  for (int c = 0; c < certificate->channels; c++) {
    any = any || certificate->channel[c].lit > 0;
  }
  return any;
}

const unsigned char *clt_certificate_lit(const clt_certificate *certificate, int channel) {
  return certificate->lit + (size_t)channel * certificate->cols;
}

const double *clt_certificate_first_bounce(const clt_certificate *certificate, int channel) {
  return certificate->first_bounce + (size_t)channel * certificate->cols;
}

const double *clt_certificate_flood(const clt_certificate *certificate, int channel) {
  return certificate->flood + (size_t)channel * certificate->rows;
}

const double *clt_certificate_reflood(const clt_certificate *certificate, int channel) {
  return certificate->reflood + (size_t)channel * certificate->rows;
}

const double *clt_certificate_flux(const clt_certificate *certificate, int channel) {
  return certificate->flux + (size_t)channel * certificate->cols;
}

const clt_model *clt_certificate_model(const clt_certificate *certificate, int channel) {
  return &certificate->model[channel];
}

bool clt_certificate_fits(const clt_certificate *certificate, const clt_transport *transport) {
  clt_transport_info info = clt_transport_describe(transport);
  return certificate->channels == info.channels && certificate->rows == info.rows && certificate->cols == info.cols;
}

clt_channel_certificate clt_certificate_worst(const clt_certificate *certificate) {
  clt_channel_certificate worst = certificate->channel[0];
  for (int c = 1; c < certificate->channels; c++) {
    const clt_channel_certificate *channel = &certificate->channel[c];
    worst.reciprocity = fmax(worst.reciprocity, channel->reciprocity);
    worst.radius_low = fmax(worst.radius_low, channel->radius_low);
    worst.radius_high = fmax(worst.radius_high, channel->radius_high);
  }
  return worst;
}
