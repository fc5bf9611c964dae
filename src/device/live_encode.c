/* What a projector that encodes by itself does, for those that cannot: on the processor. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "counterlight/device.h"
#include "image/cell_means.h"

enum { COLOURS = 3, STEPS = 1024 };

/* Where a pixel's centre lies between two cells' centres: value = (1 - part) v[cell] + part v[next]. */
typedef struct between {
  int cell, next;
  float part;
} between;

/* Codes by the square root of light, in which panel responses are nearly straight. */
typedef struct code_table {
  float code[STEPS + 2];
} code_table;

static between place(int pixel, int pixels, int cells) {
  double at = (pixel + 0.5) * cells / pixels - 0.5;
  at = at < 0 ? 0 : at > cells - 1 ? cells - 1 : at;
  int cell = (int)at;
  return (between){cell, cell + 1 < cells ? cell + 1 : cell, (float)(at - cell)};
}

static void fill_table(const clt_curve *response, code_table *table) {
  for (int k = 0; k < STEPS + 2; k++) {
    double root = (double)(k < STEPS ? k : STEPS) / STEPS;
    table->code[k] = (float)clt_curve_encode(response, root * root);
  }
}

static inline float look_up(const code_table *table, float light) {
  float at = STEPS * sqrtf(light < 0 ? 0 : light > 1 ? 1 : light);
  int k = (int)at;
  return table->code[k] + (at - (float)k) * (table->code[k + 1] - table->code[k]);
}

typedef struct encoder {
  const clt_live_picture *picture;
  int channels, height, width;
  const float *light; /* of the content, on the panel; three channels */
  between *across;
  code_table table[COLOURS];
  float *codes;
} encoder;

/* One field at a row of the panel, between two rows of cells. */
static inline float field_at(const float *upper, const float *lower, float down, const between *x) {
  float above = upper[x->cell] + x->part * (upper[x->next] - upper[x->cell]);
  float below = lower[x->cell] + x->part * (lower[x->next] - lower[x->cell]);
  return above + down * (below - above);
}

/* drive[c * width + x] of a row of the panel, 0..1. A panel of one channel shows the content's luminance (Rec. 709). */
static void drive_row(const encoder *self, int y, float *drive) {
  const clt_live_picture *picture = self->picture;
  size_t plane = (size_t)self->width * (size_t)self->height, row = (size_t)y * (size_t)self->width;
  size_t cells = (size_t)picture->grid_width * (size_t)picture->grid_height, grid = (size_t)picture->grid_width;
  between down = place(y, self->height, picture->grid_height);
  for (int c = 0; c < self->channels; c++) {
    const float *gain = picture->gain + (size_t)c * cells, *offset = picture->offset + (size_t)c * cells;
    const float *own = self->light + (size_t)c * plane + row;
    size_t upper = (size_t)down.cell * grid, lower = (size_t)down.next * grid;
    for (int x = 0; x < self->width; x++) {
      float light = self->channels == COLOURS
                        ? own[x]
                        : 0.2126F * own[x] + 0.7152F * own[plane + (size_t)x] + 0.0722F * own[2 * plane + (size_t)x];
      float value = field_at(gain + upper, gain + lower, down.part, &self->across[x]) * light +
                    field_at(offset + upper, offset + lower, down.part, &self->across[x]);
      drive[c * self->width + x] = value > 0 ? (value < 1 ? value : 1) : 0; /* NaN is dark */
    }
  }
}

/* Undoes crosstalk and responses; drive and codes may be the same row. */
static void encode_row(const encoder *self, int y, const float *drive) {
  const clt_panel *panel = &self->picture->panel;
  size_t plane = (size_t)self->width * (size_t)self->height, at = (size_t)y * (size_t)self->width;
  bool mixes = panel->mixes && self->channels == COLOURS;
  for (int k = 0; k < self->channels; k++) {
    float row[COLOURS] = {0};
    for (int c = 0; c < COLOURS; c++) {
      row[c] = mixes ? (float)panel->unmix[k][c] : c == k ? 1 : 0;
    }
    for (int x = 0; x < self->width; x++) {
      float own = 0;
      for (int c = 0; c < self->channels; c++) {
        own += row[c] * drive[c * self->width + x];
      }
      self->codes[(size_t)k * plane + at + (size_t)x] = look_up(&self->table[k], own);
    }
  }
}

static bool encode(encoder *self) {
  bool complete = true;
#pragma omp parallel reduction(&& : complete)
  {
    float *drive = clt_alloc((size_t)self->width * COLOURS, sizeof *drive);
    complete = drive != NULL;
#pragma omp for schedule(static)
    for (int y = 0; y < self->height; y++) {
      if (drive != NULL) {
        drive_row(self, y, drive);
        encode_row(self, y, drive);
      }
    }
    free(drive);
  }
  return complete;
}

clt_status clt_live_encode(const clt_live_picture *picture, int channels, int height, int width, float *codes,
                           clt_error *error) {
  encoder self = {.picture = picture, .channels = channels, .height = height, .width = width, .codes = codes};
  size_t plane = (size_t)width * (size_t)height;
  float *light = clt_alloc(COLOURS * plane, sizeof *light);
  self.across = clt_alloc((size_t)width, sizeof *self.across);
  bool ready = light != NULL && self.across != NULL;
  clt_status status =
      ready ? clt_cell_means(picture->content, picture->width, picture->height, width, height, light, error)
            : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
  if (status == CLT_OK) {
    self.light = light;
    for (int x = 0; x < width; x++) {
      self.across[x] = place(x, width, picture->grid_width);
    }
    for (int c = 0; c < channels; c++) {
      fill_table(&picture->panel.response[c], &self.table[c]);
    }
    status = encode(&self) ? CLT_OK : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
  }
  free(light);
  free(self.across);
  return status;
}

/* splitmix64's finaliser, as a number in 0..1. */
static inline float scatter(uint64_t key) {
  key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9u;
  key = (key ^ (key >> 27)) * 0x94d049bb133111ebu;
  return (float)((key ^ (key >> 31)) >> 40) * 0x1p-24F;
}

void clt_live_dither(float *codes, size_t count, int bits, uint32_t seed) {
  const float full = (float)((1 << bits) - 1);
  const uint64_t start = (uint64_t)seed << 32;
#pragma omp parallel for schedule(static)
  for (size_t k = 0; k < count; k++) {
    codes[k] = fminf(floorf(codes[k] * full + scatter((start + k) * 0x9e3779b97f4a7c15u)), full) / full;
  }
}
