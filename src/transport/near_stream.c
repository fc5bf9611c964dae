/* Near light as a stream of entries. */
#include "transport/near_stream.h"

#include <stdlib.h>

#include "base/memory.h"

/* An entry on its way into the stream. */
typedef struct place {
  int64_t at; /* in compressed rows */
  int32_t row, apart;
} place;

static int compare(const void *a, const void *b) {
  const place *left = a, *right = b;
  const int by_apart = (left->apart > right->apart) - (left->apart < right->apart);
  return by_apart != 0 ? by_apart : (left->at > right->at) - (left->at < right->at);
}

/* The entries of the rows first <= i < end that are not their cell's own, in the order of the stream. */
static size_t list_slice(size_t first, size_t end, const int64_t *start, const int32_t *cell, bool own_apart,
                         place *out) {
  size_t count = 0;
  for (size_t i = first; i < end; i++) {
    bool has_own = !own_apart;
    for (int64_t e = start[i]; e < start[i + 1]; e++) {
      if (!has_own && cell[e] == (int32_t)i) {
        has_own = true;
      } else {
        out[count++] = (place){.at = e, .row = (int32_t)i, .apart = cell[e] - (int32_t)i};
      }
    }
  }
  qsort(out, count, sizeof *out, compare);
  return count;
}

/* Cells of a slice are reached by that slice and, if at all, by those beside it. */
static bool are_apart(const clt_near_stream *near) {
  const size_t least = near->cells / CLT_SLICES;
  for (size_t e = 0; e < near->entries; e++) {
    if ((size_t)llabs((int64_t)near->row[e] - near->cell[e]) > least / 2) {
      return false;
    }
  }
  return true;
}

static void take_own(size_t cells, size_t channels, const int64_t *start, const int32_t *cell, const float *value,
                     float *own) {
  const size_t entries = (size_t)start[cells];
  for (size_t i = 0; i < cells; i++) {
    int64_t e = start[i];
    while (e < start[i + 1] && cell[e] != (int32_t)i) {
      e++;
    }
    for (size_t c = 0; c < channels; c++) {
      own[c * cells + i] = e < start[i + 1] ? value[c * entries + (size_t)e] : 0;
    }
  }
}

clt_status clt_near_stream_make(size_t cells, size_t channels, const int64_t *start, const int32_t *cell,
                                const float *value, float *own, clt_near_stream *near, clt_error *error) {
  const size_t before = (size_t)start[cells];
  place *order = clt_alloc(before, sizeof *order);
  if (order == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory to order %zu near entries", before);
  }
  *near = (clt_near_stream){.cells = cells};
  for (size_t k = 0; k < CLT_SLICES; k++) {
    near->first[k + 1] = near->first[k] + list_slice(clt_slice_first(cells, k), clt_slice_first(cells, k + 1), start,
                                                     cell, own != NULL, order + near->first[k]);
  }
  near->entries = near->first[CLT_SLICES];
  near->row = clt_alloc(near->entries, sizeof *near->row);
  near->cell = clt_alloc(near->entries, sizeof *near->cell);
  near->value = clt_alloc(near->entries, channels * sizeof *near->value);
  const bool has_room = near->row != NULL && near->cell != NULL && near->value != NULL;
  for (size_t e = 0; has_room && e < near->entries; e++) {
    near->row[e] = order[e].row;
    near->cell[e] = cell[order[e].at];
    for (size_t c = 0; c < channels; c++) {
      near->value[c * near->entries + e] = value[c * before + (size_t)order[e].at];
    }
  }
  free(order);
  if (!has_room) {
    return clt_fail(error, CLT_FAILED, "no memory for %zu near entries", near->entries);
  }
  if (own != NULL) {
    take_own(cells, channels, start, cell, value, own);
  }
  near->apart = are_apart(near);
  return CLT_OK;
}

void clt_near_stream_finish(clt_near_stream *near) {
  free(near->row);
  free(near->cell);
  free(near->value);
}

size_t clt_near_stream_bytes(const clt_near_stream *near) {
  return near->entries * (sizeof *near->row + sizeof *near->cell + sizeof *near->value);
}

/* Asks memory for entries to come: of three streams, which begin anew with every slice, it foresees too little. */
static inline void foresee(const clt_near_stream *near, const float *value, size_t entry) {
  enum { LINE = 16, AHEAD = 256 };
  if (entry % LINE == 0) {
    __builtin_prefetch(near->row + entry + AHEAD);
    __builtin_prefetch(near->cell + entry + AHEAD);
    __builtin_prefetch(value + entry + AHEAD);
  }
}

void clt_near_stream_add(const clt_near_stream *near, int channel, size_t slice, const double *x, double *y) {
  const float *value = near->value + (size_t)channel * near->entries;
  for (size_t e = near->first[slice]; e < near->first[slice + 1]; e++) {
    foresee(near, value, e);
    y[near->row[e]] += (double)value[e] * x[near->cell[e]];
  }
}

static void add_slice_transposed(const clt_near_stream *near, int channel, size_t slice, const double *y, double *x) {
  const float *value = near->value + (size_t)channel * near->entries;
  for (size_t e = near->first[slice]; e < near->first[slice + 1]; e++) {
    foresee(near, value, e);
    x[near->cell[e]] += (double)value[e] * y[near->row[e]];
  }
}

void clt_near_stream_turns(clt_turns turns[2]) {
  turns[0] = turns[1] = clt_turns_of(CLT_SLICES / 2);
}

void clt_near_stream_add_transposed(const clt_near_stream *near, int channel, clt_turns turns[2], const double *y,
                                    double *x) {
  size_t turn = 0;
  if (near->apart) {
    for (size_t odd = 0; odd < 2; odd++) {
      while (clt_turns_next(&turns[odd], &turn)) {
        add_slice_transposed(near, channel, 2 * turn + odd, y, x);
      }
#pragma omp barrier
    }
  } else {
#pragma omp single
    for (size_t slice = 0; slice < CLT_SLICES; slice++) {
      add_slice_transposed(near, channel, slice, y, x);
    }
  }
}
