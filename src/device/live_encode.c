/* What a projector that encodes by itself does, for those that cannot: on the processor, a row of the panel at a time.
 * Fields are interpolated down the grid once a row, then across it. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"
#include "counterlight/device.h"
#include "image/cell_means.h"

enum { COLOURS = 3, STEPS = 1024, CODES = 256 };

/* Where a pixel's centre lies between two cells' centres: value = (1 - part) v[cell] + part v[cell + 1]. */
typedef struct between {
  int cell;
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
  return (between){cell, (float)(at - cell)};
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
  const float *light; /* of the content, on the panel; three channels; NULL: the content has the panel's size */
  float light_of[CODES];
  between *across;
  code_table table[COLOURS];
  float *codes;
} encoder;

/* Workspace of a thread, for one row. */
typedef struct row_space {
  float *light, *drive; /* three channels of the row each */
  float *fields;        /* gain and offset of each cell beside the row, and of the last one twice */
} row_space;

static void light_row(const encoder *self, int y, float *light) {
  size_t width = (size_t)self->width, row = (size_t)y * width, plane = (size_t)self->height * width;
  const uint8_t *content = self->picture->content + row * COLOURS;
  for (size_t c = 0; c < COLOURS; c++) {
    for (size_t x = 0; x < width; x++) {
      light[c * width + x] =
          self->light != NULL ? self->light[c * plane + row + x] : self->light_of[content[x * COLOURS + c]];
    }
  }
}

/* A panel of one channel shows the content's luminance (Rec. 709). */
static void keep_luminance(size_t width, float *light) {
  for (size_t x = 0; x < width; x++) {
    light[x] = 0.2126F * light[x] + 0.7152F * light[width + x] + 0.0722F * light[2 * width + x];
  }
}

static void field_row(const clt_live_picture *picture, int c, const between *down, float *fields) {
  size_t grid = (size_t)picture->grid_width, height = (size_t)picture->grid_height;
  size_t upper = ((size_t)c * height + (size_t)down->cell) * grid;
  size_t lower = (size_t)down->cell + 1 < height ? upper + grid : upper;
  for (size_t i = 0; i < grid; i++) {
    const float *gain = picture->gain + i, *offset = picture->offset + i;
    fields[2 * i] = gain[upper] + down->part * (gain[lower] - gain[upper]);
    fields[2 * i + 1] = offset[upper] + down->part * (offset[lower] - offset[upper]);
  }
  fields[2 * grid] = fields[2 * grid - 2];
  fields[2 * grid + 1] = fields[2 * grid - 1];
}

/* drive[c * width + x] of a row of the panel, 0..1. */
static void drive_row(const encoder *self, int y, const row_space *space) {
  size_t width = (size_t)self->width;
  between down = place(y, self->height, self->picture->grid_height);
  light_row(self, y, space->light);
  if (self->channels != COLOURS) {
    keep_luminance(width, space->light);
  }
  for (int c = 0; c < self->channels; c++) {
    const float *own = space->light + (size_t)c * width;
    float *drive = space->drive + (size_t)c * width;
    field_row(self->picture, c, &down, space->fields);
    for (size_t x = 0; x < width; x++) {
      const float *field = space->fields + 2 * (size_t)self->across[x].cell;
      float part = self->across[x].part, gain = field[0] + part * (field[2] - field[0]);
      float value = gain * own[x] + field[1] + part * (field[3] - field[1]);
      drive[x] = value > 0 ? (value < 1 ? value : 1) : 0; /* NaN is dark */
    }
  }
}

/* Undoes crosstalk: light takes the place of what the content was. */
static const float *unmix_row(const encoder *self, const row_space *space) {
  const clt_panel *panel = &self->picture->panel;
  size_t width = (size_t)self->width;
  if (!panel->mixes || self->channels != COLOURS) {
    return space->drive;
  }
  for (int k = 0; k < COLOURS; k++) {
    const float row[COLOURS] = {(float)panel->unmix[k][0], (float)panel->unmix[k][1], (float)panel->unmix[k][2]};
    for (size_t x = 0; x < width; x++) {
      space->light[(size_t)k * width + x] =
          row[0] * space->drive[x] + row[1] * space->drive[width + x] + row[2] * space->drive[2 * width + x];
    }
  }
  return space->light;
}

static void encode_row(const encoder *self, int y, const row_space *space) {
  size_t width = (size_t)self->width, plane = (size_t)self->height * width;
  drive_row(self, y, space);
  const float *own = unmix_row(self, space);
  for (int k = 0; k < self->channels; k++) {
    float *codes = self->codes + (size_t)k * plane + (size_t)y * width;
    for (size_t x = 0; x < width; x++) {
      codes[x] = look_up(&self->table[k], own[(size_t)k * width + x]);
    }
  }
}

static bool encode(encoder *self) {
  size_t width = (size_t)self->width, cells = (size_t)self->picture->grid_width;
  bool complete = true;
#pragma omp parallel reduction(&& : complete)
  {
    float *values = clt_alloc(2 * COLOURS * width + 2 * (cells + 1), sizeof *values);
    complete = values != NULL;
#pragma omp for schedule(static)
    for (int y = 0; y < self->height; y++) {
      if (values != NULL) {
        const row_space space = {values, values + COLOURS * width, values + 2 * COLOURS * width};
        encode_row(self, y, &space);
      }
    }
    free(values);
  }
  return complete;
}

/* The content's light on the panel, where it has another size. */
static clt_status fit_content(encoder *self, float **light, clt_error *error) {
  const clt_live_picture *picture = self->picture;
  if (picture->width == self->width && picture->height == self->height) {
    clt_srgb_light(self->light_of);
    return CLT_OK;
  }
  *light = clt_alloc(COLOURS * (size_t)self->width * (size_t)self->height, sizeof **light);
  self->light = *light;
  return *light != NULL ? clt_cell_means(picture->content, picture->width, picture->height, self->width, self->height,
                                         *light, error)
                        : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
}

clt_status clt_live_encode(const clt_live_picture *picture, int channels, int height, int width, float *codes,
                           clt_error *error) {
  encoder self = {.picture = picture, .channels = channels, .height = height, .width = width, .codes = codes};
  float *light = NULL;
  self.across = clt_alloc((size_t)width, sizeof *self.across);
  clt_status status = self.across != NULL ? fit_content(&self, &light, error)
                                          : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
  if (status == CLT_OK) {
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

/* A number in 0..1 for each counter: 32 bits, of which vectors are multiplied at once. The multipliers are those
 * that Wellons found to bias least. */
static inline float scatter(uint32_t key) {
  key = (key ^ (key >> 16)) * 0x7feb352du;
  key = (key ^ (key >> 15)) * 0x846ca68bu;
  return (float)((key ^ (key >> 16)) >> 8) * 0x1p-24F;
}

void clt_live_dither(float *codes, size_t count, int bits, uint32_t seed) {
  const float full = (float)((1 << bits) - 1);
  const uint32_t start = (uint32_t)clt_random_scramble(seed + 1u);
#pragma omp parallel for simd schedule(static)
  for (size_t k = 0; k < count; k++) {
    float step = (float)(int)(codes[k] * full + scatter(start + (uint32_t)k));
    codes[k] = (step < full ? step : full) / full;
  }
}
