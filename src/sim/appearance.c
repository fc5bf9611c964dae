#include "sim/appearance.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* out = in transposed, tile by tile; side x side values. */
static void transpose(const float *in, size_t side, float *out) {
  enum { TILE = 32 };
#pragma omp parallel for schedule(static)
  for (size_t tile = 0; tile < side; tile += TILE) {
    size_t end = tile + TILE < side ? tile + TILE : side;
    for (size_t i = 0; i < side; i++) {
      for (size_t j = tile; j < end; j++) {
        out[j * side + i] = in[i * side + j];
      }
    }
  }
}

/* The channel before c whose T is the same, or c. */
static int twin(const clt_transport *transport, int c, size_t bytes) {
  for (int k = 0; k < c; k++) {
    if (memcmp(clt_transport_entries(transport, k), clt_transport_entries(transport, c), bytes) == 0) {
      return k;
    }
  }
  return c;
}

clt_status clt_appearance_init(clt_appearance *appearance, const clt_transport *transport, clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  size_t cells = info.cols, square = cells * cells;
  appearance->transport = transport;
  appearance->cells = cells;
  appearance->channels = info.channels;
  appearance->driven = clt_alloc(cells, sizeof *appearance->driven);
  appearance->drive = clt_alloc((size_t)info.channels * cells, sizeof *appearance->drive);
  appearance->seen = clt_alloc((size_t)info.channels * cells, sizeof *appearance->seen);
  bool enough = appearance->driven && appearance->drive && appearance->seen;
  for (int c = 0; c < info.channels && enough && clt_transport_entries(transport, c) != NULL; c++) {
    int same = twin(transport, c, square * sizeof(float));
    appearance->columns[c] = same < c ? appearance->columns[same] : clt_alloc(square, sizeof(float));
    enough = appearance->columns[c] != NULL;
    if (enough && same == c) {
      transpose(clt_transport_entries(transport, c), cells, appearance->columns[c]);
    }
  }
  return enough ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for a scene of %zu cells", cells);
}

/* Whether a channel before c holds the same columns. */
static bool shares_columns(const clt_appearance *appearance, int c) {
  for (int k = 0; k < c; k++) {
    if (appearance->columns[k] == appearance->columns[c]) {
      return true;
    }
  }
  return false;
}

void clt_appearance_finish(clt_appearance *appearance) {
  for (int c = 0; c < appearance->channels; c++) {
    if (!shares_columns(appearance, c)) {
      free(appearance->columns[c]);
    }
  }
  free(appearance->driven);
  free(appearance->drive);
  free(appearance->seen);
  *appearance = (clt_appearance){0};
}

size_t clt_appearance_bytes(const clt_appearance *appearance) {
  size_t bytes = appearance->cells * sizeof *appearance->driven +
                 (size_t)appearance->channels * appearance->cells * 2 * sizeof *appearance->drive;
  for (int c = 0; c < appearance->channels; c++) {
    if (appearance->columns[c] != NULL && !shares_columns(appearance, c)) {
      bytes += appearance->cells * appearance->cells * sizeof *appearance->columns[c];
    }
  }
  return bytes;
}

/* seen += T drive over the driven cells. Threads share out the rows, so that each row's sum has one order. */
static void add_columns(clt_appearance *appearance, const float *columns, size_t driven) {
  enum { STRIP = 256, FEW_PRODUCTS = 1 << 19 };
  size_t cells = appearance->cells;
  double *seen = appearance->seen;
#pragma omp parallel for schedule(static) if (driven * cells > FEW_PRODUCTS)
  for (size_t strip = 0; strip < cells; strip += STRIP) {
    size_t end = strip + STRIP < cells ? strip + STRIP : cells;
    for (size_t k = 0; k < driven; k++) {
      double drive = appearance->drive[appearance->driven[k]];
      const float *column = &columns[appearance->driven[k] * cells];
      for (size_t i = strip; i < end; i++) {
        seen[i] += drive * (double)column[i];
      }
    }
  }
}

/* By the columns of the cells that are driven. */
static void light_columns(clt_appearance *appearance, const float *drive, int c) {
  size_t cells = appearance->cells, driven = 0;
  for (size_t j = 0; j < cells; j++) {
    appearance->drive[j] = (double)drive[j];
    appearance->driven[driven] = j;
    driven += drive[j] != 0.0f;
  }
  memset(appearance->seen, 0, cells * sizeof *appearance->seen);
  add_columns(appearance, appearance->columns[c], driven);
}

static void add_black(const clt_appearance *appearance, int c, const double *seen, float *radiance) {
  const float *black = clt_transport_black(appearance->transport, c);
  for (size_t i = 0; i < appearance->cells; i++) {
    radiance[i] = (float)((double)black[i] + seen[i]);
  }
}

void clt_appearance_of(clt_appearance *appearance, const float *drive, float *radiance) {
  size_t cells = appearance->cells;
  if (appearance->columns[0] == NULL) {
    for (size_t k = 0; k < (size_t)appearance->channels * cells; k++) {
      appearance->drive[k] = (double)drive[k];
    }
    clt_transport_apply_all(appearance->transport, appearance->drive, appearance->seen);
  }
  for (int c = 0; c < appearance->channels; c++) {
    const double *seen = &appearance->seen[appearance->columns[0] == NULL ? (size_t)c * cells : 0];
    if (appearance->columns[0] != NULL) {
      light_columns(appearance, &drive[(size_t)c * cells], c);
    }
    add_black(appearance, c, seen, &radiance[(size_t)c * cells]);
  }
}
