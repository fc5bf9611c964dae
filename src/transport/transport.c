#include <stdlib.h>

#include "base/memory.h"
#include "transport/kind.h"

const clt_kind *const clt_kinds[] = {&clt_kind_dense, &clt_kind_dense64, &clt_kind_dense16,   &clt_kind_dense8,
                                     &clt_kind_tree,  &clt_kind_blocks,  &clt_kind_hierarchy, NULL};

clt_status clt_transport_begin(const clt_kind *kind, int width, int height, int channels, const char *source,
                               clt_transport **out, clt_error *error) {
  *out = NULL;
  if (width < 1 || width > CLT_GRID_SIDE_MAX || height < 1 || height > CLT_GRID_SIDE_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: a grid of %d x %d cells; each side is 1..%d", source, width, height,
                    CLT_GRID_SIDE_MAX);
  }
  if (channels < 1 || channels > CLT_CHANNELS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %d channels; 1..%d are possible", source, channels, CLT_CHANNELS_MAX);
  }
  clt_transport *transport = clt_alloc(1, sizeof *transport);
  if (transport == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: no memory for a transport", source);
  }
  transport->kind = kind;
  transport->width = width;
  transport->height = height;
  transport->channels = channels;
  transport->cols = (size_t)width * (size_t)height;
  transport->provenance.error = -1;
  *out = transport;
  return CLT_OK;
}

clt_status clt_transport_set_rows(clt_transport *transport, size_t rows, const char *source, clt_error *error) {
  const size_t most = (size_t)CLT_GRID_SIDE_MAX * CLT_GRID_SIDE_MAX;
  if (rows < 1 || rows > most) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %zu rows (observed cells); 1..%zu are possible", source, rows, most);
  }
  transport->rows = rows;
  return CLT_OK;
}

clt_status clt_transport_too_large(const clt_transport *transport, size_t bytes, clt_error *error) {
  return clt_fail(error, CLT_FAILED,
                  "a dense transport of %d x %zu x %zu entries needs %.1f GiB, more than there is: use a smaller grid "
                  "or tree storage",
                  transport->channels, transport->rows, transport->cols, (double)bytes / 0x1p30);
}

void clt_transport_destroy(clt_transport *transport) {
  if (transport == NULL) {
    return;
  }
  transport->kind->destroy(transport);
  free(transport->black);
  free(transport->flood);
  free(transport->sigma);
  free(transport);
}

clt_transport_info clt_transport_describe(const clt_transport *transport) {
  return (clt_transport_info){.width = transport->width,
                              .height = transport->height,
                              .channels = transport->channels,
                              .rows = transport->rows,
                              .cols = transport->cols,
                              .storage = transport->kind->name,
                              .bytes = transport->kind->bytes(transport)};
}

clt_provenance *clt_transport_provenance(clt_transport *transport) {
  return &transport->provenance;
}

const clt_provenance *clt_transport_origin(const clt_transport *transport) {
  return &transport->provenance;
}

/* A channel's part of values that stand row by row, or NULL where there are none. */
static float *of_channel(const clt_transport *transport, float *values, int channel) {
  return values == NULL ? NULL : values + (size_t)channel * transport->rows;
}

static clt_status keep(const clt_transport *transport, const char *what, float **values, clt_error *error) {
  if (*values == NULL) {
    *values = clt_alloc(transport->rows * (size_t)transport->channels, sizeof **values);
  }
  return *values != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "no memory for the %s of %zu observed cells", what, transport->rows);
}

clt_status clt_transport_keep_black(clt_transport *transport, clt_error *error) {
  return keep(transport, "black", &transport->black, error);
}

float *clt_transport_black(const clt_transport *transport, int channel) {
  return of_channel(transport, transport->black, channel);
}

const float *clt_transport_flood(const clt_transport *transport, int channel) {
  return of_channel(transport, transport->flood, channel);
}

clt_status clt_transport_keep_flood(clt_transport *transport, clt_error *error) {
  return keep(transport, "flood", &transport->flood, error);
}

float *clt_transport_flood_values(clt_transport *transport, int channel) {
  return of_channel(transport, transport->flood, channel);
}

const float *clt_transport_sigma(const clt_transport *transport, int channel) {
  return of_channel(transport, transport->sigma, channel);
}

clt_status clt_transport_keep_sigma(clt_transport *transport, clt_error *error) {
  return keep(transport, "standard deviation", &transport->sigma, error);
}

float *clt_transport_sigma_values(clt_transport *transport, int channel) {
  return of_channel(transport, transport->sigma, channel);
}

float *clt_transport_entries(const clt_transport *transport, int channel) {
  return transport->kind->entries(transport, channel);
}

void clt_transport_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  transport->kind->apply(transport, channel, x, y);
}

void clt_transport_apply_all(const clt_transport *transport, const double *x, double *y) {
  if (transport->kind->apply_all != NULL) {
    transport->kind->apply_all(transport, x, y);
    return;
  }
  for (int c = 0; c < transport->channels; c++) {
    transport->kind->apply(transport, c, x + (size_t)c * transport->cols, y + (size_t)c * transport->rows);
  }
}

clt_status clt_transport_row(const clt_transport *transport, int channel, size_t i, double *row, clt_error *error) {
  if (transport->kind->row != NULL) {
    transport->kind->row(transport, channel, i, row);
    return CLT_OK;
  }
  double *unit = clt_alloc(transport->rows, sizeof *unit);
  if (unit == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a row of %zu cells", transport->cols);
  }
  unit[i] = 1;
  transport->kind->apply_transposed(transport, channel, unit, row);
  free(unit);
  return CLT_OK;
}

void clt_transport_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  transport->kind->apply_transposed(transport, channel, y, x);
}

void clt_transport_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  transport->kind->diagonal(transport, channel, diagonal);
}

void clt_transport_row_sums(const clt_transport *transport, int channel, double *sums) {
  transport->kind->row_sums(transport, channel, sums);
}
