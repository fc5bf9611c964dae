/* Area means are separable: pixel rows are summed over a row of cells, then the sums over each cell's columns. */
#include "image/cell_means.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "counterlight/image.h"
#include "image/light_kernels.h"

enum {
  CODES = 256,
  COLOURS = 3,
  PAD = 16, /* numbers between rows, of which a pixel read as a vector takes one */
  ROWS_AT_ONCE = 16,
  WORTH_SHARING = 1 << 16 /* codes that pay for waking threads */
};

/* Inputs first..last that lie in output j of m, of n inputs; the first and the last may lie in it partly. In units of
 * 1 / m of an input the output is [j n, (j + 1) n). */
typedef struct span {
  int first, last;
  float before, after; /* the shares of the first and the last, where first < last; else of the only one, in before */
} span;

static span span_of(int j, int n, int m) {
  int64_t begin = (int64_t)j * n, end = begin + n;
  span found = {.first = (int)(begin / m), .last = (int)((end - 1) / m)};
  found.before = (float)((double)((found.first + 1) * (int64_t)m - begin) / m);
  found.after = (float)((double)(end - found.last * (int64_t)m) / m);
  if (found.first == found.last) {
    found.before = (float)((double)n / m);
  }
  return found;
}

/* Red, green, blue of a pixel and whatever comes after them: four numbers make a vector everywhere. */
typedef float pixel __attribute__((vector_size(4 * sizeof(float))));

static inline void add_pixel(const float *sums, int x, float weight, pixel *to) {
  pixel own;
  memcpy(&own, sums + COLOURS * (size_t)x, sizeof own);
  *to += weight * own;
}

/* One cell's mean: sums over its columns, times 1 / area. */
static inline void mean_columns(const float *sums, const span *columns, float scale, size_t plane, float *mean) {
  pixel sum = {0};
  add_pixel(sums, columns->first, columns->before, &sum);
  for (int x = columns->first + 1; x < columns->last; x++) {
    add_pixel(sums, x, 1, &sum);
  }
  if (columns->last > columns->first) {
    add_pixel(sums, columns->last, columns->after, &sum);
  }
  for (size_t c = 0; c < COLOURS; c++) {
    mean[c * plane] = scale * sum[c];
  }
}

/* What every row of cells is averaged by. */
typedef struct averaging {
  const clt_light_kernels *kernels;
  clt_light_table table;
  const uint8_t *content;
  size_t row; /* codes */
  int content_height, width, height;
  float scale;
  span *columns;
  float *sums; /* two rows of each thread */
} averaging;

/* A row of cells; *kept is the row of content whose light is in `light`, -1: none. */
static void mean_row(const averaging *self, int y, float *sums, float *light, int *kept, float *means) {
  const size_t width = (size_t)self->width, plane = width * (size_t)self->height;
  const span rows = span_of(y, self->content_height, self->height);
  const uint8_t *first = self->content + (size_t)rows.first * self->row;
  const clt_light_rows more = {first + self->row, self->row, (size_t)(rows.last - rows.first), rows.before, rows.after};
  if (*kept != rows.first) {
    self->kernels->look_up(&self->table, first, self->row, light);
  }
  self->kernels->add_rows(&self->table, &more, self->row, light, sums);
  *kept = rows.last;
  for (size_t x = 0; x < width; x++) {
    mean_columns(sums, &self->columns[x], self->scale, plane, means + (size_t)y * width + x);
  }
}

static void mean_rows(const averaging *self, float *means) {
  const size_t space = self->row + PAD;
  const bool shared = self->row * (size_t)self->content_height >= WORTH_SHARING;
#pragma omp parallel if (shared)
  {
    float *sums = self->sums + 2 * space * (size_t)omp_get_thread_num();
    int kept = -1;
#pragma omp for schedule(dynamic, ROWS_AT_ONCE)
    for (int y = 0; y < self->height; y++) {
      mean_row(self, y, sums, sums + space, &kept, means);
    }
  }
}

clt_status clt_cell_means(const uint8_t *content, int content_width, int content_height, int width, int height,
                          float *means, clt_error *error) {
  averaging self = {.kernels = clt_light_choose(),
                    .content = content,
                    .row = (size_t)content_width * COLOURS,
                    .content_height = content_height,
                    .width = width,
                    .height = height,
                    .scale = (float)((double)width / content_width * height / content_height)};
  self.sums = clt_alloc(2 * (self.row + PAD) * (size_t)omp_get_max_threads(), sizeof *self.sums);
  self.columns = clt_alloc((size_t)width, sizeof *self.columns);
  clt_status status = CLT_OK;
  if (self.sums != NULL && self.columns != NULL) {
    for (int x = 0; x < width; x++) {
      self.columns[x] = span_of(x, content_width, width);
    }
    clt_light_fill(&self.table);
    mean_rows(&self, means);
  } else {
    status = clt_fail(error, CLT_FAILED, "memory is short to average a picture over %d cells", width);
  }
  free(self.sums);
  free(self.columns);
  return status;
}

/* A code is the number of thresholds, the light halfway between two codes, that lie below. */
void clt_srgb_codes(const float *light, size_t count, uint8_t *codes) {
  const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  float threshold[CODES];
  for (int code = 0; code < CODES - 1; code++) {
    threshold[code] = (float)clt_curve_decode(&srgb, (code + 0.5) / (CODES - 1));
  }
  threshold[CODES - 1] = INFINITY;
#pragma omp parallel for schedule(static)
  for (size_t k = 0; k < count; k++) {
    for (int c = 0; c < COLOURS; c++) {
      float value = light[(size_t)c * count + k];
      unsigned code = 0;
      for (unsigned step = CODES / 2; step > 0; step /= 2) {
        code += threshold[code + step - 1] < value ? step : 0;
      }
      codes[COLOURS * k + (size_t)c] = (uint8_t)code;
    }
  }
}
