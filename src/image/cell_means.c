/* Area means are separable: pixel rows are summed over a row of cells, then the sums over each cell's columns. */
#include "image/cell_means.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "counterlight/image.h"

enum { CODES = 256, COLOURS = 3 };

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

static float share(const span *of, int k) {
  return k == of->first ? of->before : k == of->last ? of->after : 1.0F;
}

/* sums[i] = sum over the span's rows of share * light. */
static void sum_rows(const uint8_t *content, size_t row, const span *rows, const float *light, float *sums) {
  for (int y = rows->first; y <= rows->last; y++) {
    const uint8_t *codes = content + (size_t)y * row;
    float weight = share(rows, y);
    if (y == rows->first) {
      for (size_t i = 0; i < row; i++) {
        sums[i] = weight * light[codes[i]];
      }
    } else {
      for (size_t i = 0; i < row; i++) {
        sums[i] += weight * light[codes[i]];
      }
    }
  }
}

/* One cell's mean: sums over its columns, times 1 / area. */
static void mean_columns(const float *sums, const span *columns, float scale, size_t plane, float *mean) {
  float sum[COLOURS] = {0};
  for (int x = columns->first; x <= columns->last; x++) {
    float weight = share(columns, x);
    for (int c = 0; c < COLOURS; c++) {
      sum[c] += weight * sums[COLOURS * x + c];
    }
  }
  for (int c = 0; c < COLOURS; c++) {
    mean[(size_t)c * plane] = scale * sum[c];
  }
}

void clt_srgb_light(float light[CODES]) {
  const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  for (int code = 0; code < CODES; code++) {
    light[code] = (float)clt_curve_decode(&srgb, code / (double)(CODES - 1));
  }
}

clt_status clt_cell_means(const uint8_t *content, int content_width, int content_height, int width, int height,
                          float *means, clt_error *error) {
  float light[CODES];
  size_t row = (size_t)content_width * COLOURS, plane = (size_t)width * (size_t)height;
  float *sums = clt_alloc(row * (size_t)omp_get_max_threads(), sizeof *sums);
  span *columns = clt_alloc((size_t)width, sizeof *columns);
  float scale = (float)((double)width / content_width * height / content_height);
  bool ready = sums != NULL && columns != NULL;
  clt_srgb_light(light);
  for (int x = 0; ready && x < width; x++) {
    columns[x] = span_of(x, content_width, width);
  }
#pragma omp parallel for schedule(static)
  for (int y = 0; y < height; y++) {
    if (ready) {
      float *own = sums + row * (size_t)omp_get_thread_num();
      span rows = span_of(y, content_height, height);
      sum_rows(content, row, &rows, light, own);
      for (int x = 0; x < width; x++) {
        mean_columns(own, &columns[x], scale, plane, means + (size_t)y * (size_t)width + (size_t)x);
      }
    }
  }
  free(sums);
  free(columns);
  return ready ? CLT_OK : clt_fail(error, CLT_FAILED, "memory is short to average a picture over %d cells", width);
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
