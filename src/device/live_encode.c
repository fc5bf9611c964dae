/* What a projector that encodes by itself does, for those that cannot: on the processor, a row of the panel at a time.
 * Fields are interpolated across each row of cells once, then down between two of them. */
#include "device/live_encode.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "device/live_kernels.h"
#include "image/cell_means.h"
#include "image/light_kernels.h"

enum {
  COLOURS = CLT_LIVE_COLOURS,
  FIELDS = 2, /* gain and offset */
  ROWS_AT_ONCE = 64,
  CHUNKS_AT_ONCE = 16,
  WORTH_SHARING = 1 << 16, /* codes that pay for waking threads */
  DITHERED = 1 << 12       /* codes at once */
};

typedef struct encoder {
  const clt_live_picture *picture;
  const clt_live_row_kernels *rows;
  const clt_light_kernels *codes_to_light;
  int channels, height, width;
  float *light; /* of the content, on the panel; three channels; NULL: the content has the panel's size */
  clt_light_table light_of;
  int32_t *cell; /* left of each column of the panel, */
  float *across; /* and how far the column is from it to the next one */
  clt_live_piece table[COLOURS][CLT_LIVE_PIECES];
  float *codes;     /* what is wanted; NULL: */
  uint32_t *pixels; /* these are */
} encoder;

/* Workspace of a thread, for one row. */
typedef struct row_space {
  float *light, *drive; /* three channels of the row each */
  float *part;
  int32_t *at;
  uint8_t *plane;  /* codes of the content, three channels */
  float *own;      /* a field along a row of cells, and CLT_LIVE_PAD more */
  float *field[2]; /* on two rows of cells: gain and offset of three channels along the panel */
  int cells[2];    /* which rows these are, -1: none */
  void *memory;
} row_space;

/* Where a pixel's centre lies between two cells' centres, in cells. */
static double place(int pixel, int pixels, int cells) {
  double at = (pixel + 0.5) * cells / pixels - 0.5;
  return at < 0 ? 0 : at > cells - 1 ? cells - 1 : at;
}

/* Gain and offset of every channel along the panel, on a row of cells. */
static void expand_fields(const encoder *self, int cells, const row_space *space, float *field) {
  const clt_live_picture *picture = self->picture;
  const size_t grid = (size_t)picture->grid_width, plane = grid * (size_t)picture->grid_height;
  for (size_t k = 0; k < FIELDS * (size_t)self->channels; k++) {
    const float *whole = k % FIELDS == 0 ? picture->gain : picture->offset;
    memcpy(space->own, whole + k / FIELDS * plane + (size_t)cells * grid, grid * sizeof *space->own);
    space->own[grid] = space->own[grid - 1];
    self->rows->expand(space->own, self->cell, self->across, (size_t)self->width, field + k * (size_t)self->width);
  }
}

/* Has the fields ready on the rows of cells `upper` and the next; the last is its own next. */
static void reach_cells(const encoder *self, int upper, row_space *space) {
  if (space->cells[1] == upper) {
    float *above = space->field[1];
    space->field[1] = space->field[0];
    space->field[0] = above;
    space->cells[1] = space->cells[0];
    space->cells[0] = upper;
  }
  for (int k = 0; k < 2; k++) {
    const int wanted = upper + k < self->picture->grid_height ? upper + k : upper;
    if (space->cells[k] != wanted) {
      expand_fields(self, wanted, space, space->field[k]);
      space->cells[k] = wanted;
    }
  }
}

static void light_row(const encoder *self, int y, const row_space *space) {
  const size_t width = (size_t)self->width, row = (size_t)y * width, plane = (size_t)self->height * width;
  if (self->light == NULL) {
    self->rows->split(self->picture->content + row * COLOURS, width, space->plane);
    self->codes_to_light->look_up(&self->light_of, space->plane, COLOURS * width, space->light);
    return;
  }
  for (size_t c = 0; c < COLOURS; c++) {
    memcpy(space->light + c * width, self->light + c * plane + row, width * sizeof(float));
  }
}

/* A panel of one channel shows the content's luminance (Rec. 709). */
static void keep_luminance(size_t width, float *light) {
  for (size_t x = 0; x < width; x++) {
    light[x] = 0.2126F * light[x] + 0.7152F * light[width + x] + 0.0722F * light[2 * width + x];
  }
}

/* drive[c * width + x] of a row of the panel, 0..1. */
static void drive_row(const encoder *self, int y, row_space *space) {
  const size_t width = (size_t)self->width;
  const double down = place(y, self->height, self->picture->grid_height);
  reach_cells(self, (int)down, space);
  light_row(self, y, space);
  if (self->channels != COLOURS) {
    keep_luminance(width, space->light);
  }
  for (size_t c = 0; c < (size_t)self->channels; c++) {
    const float *upper = space->field[0] + c * FIELDS * width, *lower = space->field[1] + c * FIELDS * width;
    const clt_live_field gain = {upper, lower}, offset = {upper + width, lower + width};
    self->rows->drive(&gain, &offset, (float)(down - (int)down), space->light + c * width, width,
                      space->drive + c * width);
  }
}

/* Undoes crosstalk, clipped to 0..1: light takes the place of what the content was. */
static float *unmix_row(const encoder *self, const row_space *space) {
  const clt_panel *panel = &self->picture->panel;
  const size_t width = (size_t)self->width;
  const float *red = space->drive, *green = red + width, *blue = green + width;
  if (!panel->mixes || self->channels != COLOURS) {
    return space->drive;
  }
  for (size_t k = 0; k < COLOURS; k++) {
    const float row[COLOURS] = {(float)panel->unmix[k][0], (float)panel->unmix[k][1], (float)panel->unmix[k][2]};
    float *light = space->light + k * width;
    for (size_t x = 0; x < width; x++) {
      float own = row[0] * red[x] + row[1] * green[x] + row[2] * blue[x];
      own = own > 0 ? own : 0;
      light[x] = own < 1 ? own : 1;
    }
  }
  return space->light;
}

/* Of the numbers in 0..1 that dither a picture: the first one's counter. */
static uint32_t dither_start(uint32_t seed) {
  return (uint32_t)clt_random_scramble(seed + 1u);
}

static void encode_row(const encoder *self, int y, row_space *space) {
  const size_t width = (size_t)self->width, plane = (size_t)self->height * width, row = (size_t)y * width;
  const float *codes[COLOURS] = {0};
  uint32_t start[COLOURS];
  drive_row(self, y, space);
  float *own = unmix_row(self, space);
  for (size_t k = 0; k < (size_t)self->channels; k++) {
    float *to = self->codes != NULL ? self->codes + k * plane + row : own + k * width;
    self->rows->place(own + k * width, width, space->at, space->part);
    self->rows->interpolate(self->table[k], space->at, space->part, width, to);
    codes[k] = to;
    start[k] = dither_start(self->picture->seed) + (uint32_t)(k * plane + row);
  }
  if (self->pixels != NULL) {
    self->rows->paint(codes, start, width, self->pixels + row);
  }
}

static bool open_space(const encoder *self, row_space *space) {
  enum { ROWS = 2 * COLOURS + 2 + 2 * COLOURS * FIELDS + 1 }; /* codes of three channels are within one of floats */
  const size_t width = (size_t)self->width;
  float *next = clt_alloc(ROWS * width + (size_t)self->picture->grid_width + CLT_LIVE_PAD, sizeof *next);
  *space = (row_space){.memory = next, .cells = {-1, -1}};
  if (next == NULL) {
    return false;
  }
  space->light = next;
  space->drive = space->light + COLOURS * width;
  space->part = space->drive + COLOURS * width;
  space->at = (int32_t *)(space->part + width);
  space->plane = (uint8_t *)(space->part + 2 * width);
  space->field[0] = space->part + 3 * width;
  space->field[1] = space->field[0] + COLOURS * FIELDS * width;
  space->own = space->field[1] + COLOURS * FIELDS * width;
  return true;
}

static bool encode(encoder *self) {
  const bool shared = (size_t)self->height * (size_t)self->width * COLOURS >= WORTH_SHARING;
  bool complete = true;
#pragma omp parallel reduction(&& : complete) if (shared)
  {
    row_space space;
    complete = open_space(self, &space);
#pragma omp for schedule(static)
    for (int c = 0; c < self->channels; c++) {
      clt_live_tabulate(&self->picture->panel.response[c], self->table[c]);
    }
#pragma omp for schedule(dynamic, ROWS_AT_ONCE)
    for (int y = 0; y < self->height; y++) {
      if (complete) {
        encode_row(self, y, &space);
      }
    }
    free(space.memory);
  }
  return complete;
}

/* The content's light on the panel, where it has another size. */
static clt_status fit_content(encoder *self, clt_error *error) {
  const clt_live_picture *picture = self->picture;
  if (picture->width == self->width && picture->height == self->height) {
    clt_light_fill(&self->light_of);
    return CLT_OK;
  }
  self->light = clt_alloc(COLOURS * (size_t)self->width * (size_t)self->height, sizeof *self->light);
  return self->light != NULL ? clt_cell_means(picture->content, picture->width, picture->height, self->width,
                                              self->height, self->light, error)
                             : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
}

static clt_status run(encoder *self, clt_error *error) {
  const size_t width = (size_t)self->width;
  self->rows = clt_live_row_choose();
  self->codes_to_light = clt_light_choose();
  self->cell = clt_alloc(width, sizeof *self->cell);
  self->across = clt_alloc(width, sizeof *self->across);
  clt_status status = self->cell != NULL && self->across != NULL
                          ? fit_content(self, error)
                          : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
  if (status == CLT_OK) {
    for (int x = 0; x < self->width; x++) {
      const double at = place(x, self->width, self->picture->grid_width);
      self->cell[x] = (int32_t)at;
      self->across[x] = (float)(at - self->cell[x]);
    }
    status = encode(self) ? CLT_OK : clt_fail(error, CLT_FAILED, "a moving picture: out of memory");
  }
  free(self->light);
  free(self->cell);
  free(self->across);
  return status;
}

clt_status clt_live_encode(const clt_live_picture *picture, int channels, int height, int width, float *codes,
                           clt_error *error) {
  encoder self = {.picture = picture, .channels = channels, .height = height, .width = width, .codes = codes};
  return run(&self, error);
}

clt_status clt_live_paint(const clt_live_picture *picture, int height, int width, uint32_t *pixels, clt_error *error) {
  encoder self = {.picture = picture, .channels = COLOURS, .height = height, .width = width, .pixels = pixels};
  return run(&self, error);
}

void clt_live_dither(float *codes, size_t count, int bits, uint32_t seed) {
  const clt_live_row_kernels *rows = clt_live_row_choose();
  const float full = (float)((1 << bits) - 1);
  const uint32_t start = dither_start(seed);
#pragma omp parallel for schedule(dynamic, CHUNKS_AT_ONCE) if (count >= WORTH_SHARING)
  for (size_t k = 0; k < count; k += DITHERED) {
    rows->dither(codes + k, count - k < DITHERED ? count - k : DITHERED, full, start + (uint32_t)k);
  }
}
