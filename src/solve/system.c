#include "solve/system.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

/* Of all channels together: a channel below this is not worth the iterations that its own tolerance would cost. */
static const double FAINT = 1e-6;

clt_status clt_system_init(clt_system *system, const clt_transport *transport, bool together, clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  size_t channels = together ? (size_t)info.channels : 1;
  *system = (clt_system){.transport = transport,
                         .rows = channels * info.rows,
                         .cols = channels * info.cols,
                         .channels = (int)channels,
                         .square = info.rows == info.cols};
  system->stride = system->rows > system->cols ? system->rows : system->cols;
  system->scale = clt_alloc(system->cols, sizeof(double));
  system->drive = clt_alloc(system->cols, sizeof(double));
  system->light = clt_alloc(system->cols, sizeof(double));
  system->seen = clt_alloc(system->rows, sizeof(double));
  system->wanted = clt_alloc(system->rows, sizeof(double));
  if (system->scale == NULL || system->drive == NULL || system->light == NULL || system->seen == NULL ||
      system->wanted == NULL) {
    clt_system_finish(system);
    return clt_fail(error, CLT_FAILED, "not enough memory to solve for %zu cells", info.cols);
  }
  return CLT_OK;
}

void clt_system_finish(clt_system *system) {
  free(system->scale);
  free(system->drive);
  free(system->light);
  free(system->seen);
  free(system->wanted);
  free(system->pool);
  *system = (clt_system){0};
}

void clt_system_select(clt_system *system, int channel, const double *first_bounce, const unsigned char *lit) {
  system->channel = channel;
  system->first_bounce = first_bounce;
  system->lit = lit;
  system->flux = system->flood = system->reflood = NULL;
  system->prepared = NULL;
  system->reciprocity = 0;
  system->wanted_norm = 0;
  for (size_t j = 0; j < system->cols; j++) {
    system->scale[j] = lit[j] ? 1 / first_bounce[j] : 0;
  }
  memset(system->light, 0, system->cols * sizeof(double));
  memset(system->wanted, 0, system->rows * sizeof(double));
}

bool clt_system_row_is_lit(const clt_system *system, size_t row) {
  return !system->square || system->lit[row];
}

void clt_system_want(clt_system *system, const double *wanted) {
  for (size_t i = 0; i < system->rows; i++) {
    system->wanted[i] = clt_system_row_is_lit(system, i) ? wanted[i] : 0;
  }
  system->wanted_norm = clt_norm(system->rows, system->wanted);
  system->wanted_least = clt_system_least_norm(system, system->wanted, system->rows);
}

double clt_system_least_norm(const clt_system *system, const double *values, size_t count) {
  size_t part = count / (size_t)system->channels;
  double least = INFINITY, whole = clt_norm(count, values);
  for (int c = 0; c < system->channels; c++) {
    double norm = clt_norm(part, values + (size_t)c * part);
    least = norm > 0 ? fmin(least, norm) : least;
  }
  return fmax(fmin(least, whole), FAINT * whole);
}

clt_status clt_system_reserve(clt_system *system, size_t vectors, clt_error *error) {
  if (vectors <= system->pool_vectors) {
    return CLT_OK;
  }
  free(system->pool);
  system->pool_vectors = 0;
  system->pool = clt_alloc(vectors, system->stride * sizeof(double));
  if (system->pool == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for %zu vectors of %zu cells", vectors, system->stride);
  }
  system->pool_vectors = vectors;
  return CLT_OK;
}

double *clt_system_vector(const clt_system *system, size_t index) {
  return system->pool + index * system->stride;
}

static void drop_dark_rows(const clt_system *system, double *values) {
  if (!system->square) {
    return;
  }
  for (size_t i = 0; i < system->rows; i++) {
    values[i] = system->lit[i] ? values[i] : 0;
  }
}

static void apply_transport(const clt_system *system, const double *x, double *y) {
  if (system->channels > 1) {
    clt_transport_apply_all(system->transport, x, y);
  } else {
    clt_transport_apply(system->transport, system->channel, x, y);
  }
}

static void apply_transport_transposed(const clt_system *system, const double *y, double *x) {
  size_t channels = (size_t)system->channels;
  for (size_t c = 0; c < channels; c++) {
    clt_transport_apply_transposed(system->transport, system->channel + (int)c, y + c * (system->rows / channels),
                                   x + c * (system->cols / channels));
  }
}

void clt_system_apply(clt_system *system, const double *l, double *out) {
  for (size_t j = 0; j < system->cols; j++) {
    system->drive[j] = l[j] * system->scale[j];
  }
  apply_transport(system, system->drive, out);
  drop_dark_rows(system, out);
  system->products++;
}

void clt_system_apply_transposed(clt_system *system, const double *r, double *out) {
  clt_copy(system->rows, r, system->seen);
  drop_dark_rows(system, system->seen);
  apply_transport_transposed(system, system->seen, out);
  for (size_t j = 0; j < system->cols; j++) {
    out[j] = system->lit[j] ? out[j] * system->scale[j] : 0; /* a dark column may hold NaN */
  }
  system->products++;
}

static bool is_zero(size_t count, const double *values) {
  size_t i = 0;
  while (i < count && values[i] == 0) {
    i++;
  }
  return i == count;
}

double clt_system_residual(clt_system *system, const double *l, double *r) {
  if (is_zero(system->cols, l)) {
    clt_copy(system->rows, system->wanted, r);
    return system->wanted_norm;
  }
  clt_system_apply(system, l, r);
  for (size_t i = 0; i < system->rows; i++) {
    r[i] = system->wanted[i] - r[i];
  }
  return clt_norm(system->rows, r);
}

void clt_system_drive_residual(clt_system *system, const double *drive, double *r) {
  apply_transport(system, drive, r);
  for (size_t i = 0; i < system->rows; i++) {
    r[i] = clt_system_row_is_lit(system, i) ? system->wanted[i] - r[i] : 0;
  }
}
