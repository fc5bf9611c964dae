#include "sim/view.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/shown.h"

/* Values of an image that one thread forms sooner than several have met on a busy machine. */
enum { FEW_VALUES = 1 << 14 };

/* Where the radiance that a ray brings lies in the layers, -1 for none; and what became of the ray. */
typedef struct glimpse {
  int element;
  clt_sightline_fate fate;
} glimpse;

/* What tracing pixels needs, and the entries of one row of them. */
typedef struct tracer {
  const clt_scene_description *description;
  const clt_visibility *visibility;
  const clt_shown *shown;
  const glimpse *corners;          /* of the pixels: (width + 1) x (height + 1) */
  int *count;                      /* of each pixel: its entries */
  int *element;                    /* rays * rays for each pixel, of which the first `count` are there */
  double *weight;                  /* likewise */
  long fates[CLT_SIGHTLINE_FATES]; /* of the row's rays */
} tracer;

static int clamp(double value, int count) {
  return value >= count ? count - 1 : value > 0.0 ? (int)value : 0;
}

static int element_of(const tracer *t, const clt_sightline *line) {
  int width = t->description->width, height = t->description->height;
  if (line->surface < 0) {
    return -1;
  }
  bool lit = line->fate == CLT_SIGHTLINE_LIT;
  int column = clamp(line->x, width), row = clamp(line->y, height), cell = row * width + column;
  if (!lit || t->shown->surface[cell] < 0) {
    cell = clt_shown_nearest(t->shown, line->surface, column, row);
  }
  return cell < 0 || lit ? cell : t->description->channels * width * height + cell;
}

static glimpse look(const tracer *t, double column, double row) {
  clt_sightline line = clt_sightline_trace(t->description, t->visibility, column, row);
  return (glimpse){.element = element_of(t, &line), .fate = line.fate};
}

static bool alike(const glimpse *a, const glimpse *b) {
  return a->element == b->element && a->fate == b->fate;
}

/* Whether the pixel's corners and its middle see the same. A cell seen on a flat surface is convex, so that then all
 * of the pixel sees it. */
static bool sees_one(const tracer *t, int column, int row, const glimpse *middle) {
  size_t across = (size_t)t->description->camera.width + 1;
  const glimpse *top = &t->corners[(size_t)row * across + (size_t)column], *bottom = top + across;
  return alike(&top[0], middle) && alike(&top[1], middle) && alike(&bottom[0], middle) && alike(&bottom[1], middle);
}

static void add_share(int *element, double *weight, int *count, int to, double share) {
  int k = 0;
  while (k < *count && element[k] != to) {
    k++;
  }
  if (k == *count) {
    element[k] = to;
    weight[k] = 0.0;
    ++*count;
  }
  weight[k] += share;
}

static void trace_pixel(tracer *t, int column, int row) {
  int rays = t->description->camera.rays * t->description->camera.rays, side = t->description->camera.rays;
  int *element = &t->element[(size_t)column * (size_t)rays];
  double *weight = &t->weight[(size_t)column * (size_t)rays];
  glimpse seen = look(t, column + 0.5, row + 0.5);
  bool one = sees_one(t, column, row, &seen);
  t->count[column] = 0;
  for (int ray = 0; ray < (one ? 1 : rays); ray++) {
    if (!one) {
      seen = look(t, column + (ray % side + 0.5) / side, row + (ray / side + 0.5) / side);
    }
    t->fates[seen.fate] += one ? rays : 1;
    if (seen.element >= 0) {
      add_share(element, weight, &t->count[column], seen.element, one ? 1.0 : 1.0 / rays);
    }
  }
}

static bool append_row(clt_view *view, const tracer *t) {
  int rays = t->description->camera.rays * t->description->camera.rays;
  bool fits = true;
  for (int column = 0; column < view->width && fits; column++) {
    size_t first = (size_t)column * (size_t)rays;
    fits = clt_weights_append(&view->pixels, &t->element[first], &t->weight[first], t->count[column]);
  }
  for (int k = 0; k < CLT_SIGHTLINE_FATES; k++) {
    view->share[k] += t->fates[k] / ((double)rays * view->width * view->height);
  }
  return fits;
}

static void finish_tracer(tracer *t) {
  free(t->count);
  free(t->element);
  free(t->weight);
}

/* A row of pixels at a time, appended in their order; false where memory is short. */
static bool trace_rows(clt_view *view, const tracer *common) {
  size_t rays = (size_t)(common->description->camera.rays * common->description->camera.rays);
  size_t width = (size_t)view->width;
  bool fits = true;
#pragma omp parallel
  {
    tracer t = *common;
    t.count = clt_alloc(width, sizeof *t.count);
    t.element = clt_alloc(width * rays, sizeof *t.element);
    t.weight = clt_alloc(width * rays, sizeof *t.weight);
    bool ready = t.count && t.element && t.weight;
#pragma omp for ordered schedule(dynamic)
    for (int row = 0; row < view->height; row++) {
      memset(t.fates, 0, sizeof t.fates);
      for (int column = 0; column < view->width && ready; column++) {
        trace_pixel(&t, column, row);
      }
#pragma omp ordered
      fits = fits && ready && append_row(view, &t);
    }
    finish_tracer(&t);
  }
  return fits;
}

static clt_status out_of_memory(const clt_scene_description *description, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s: out of memory for what %d x %d pixels see; give the camera fewer",
                  description->path, description->camera.width, description->camera.height);
}

static void look_at_corners(const tracer *t, glimpse *corners) {
  int across = t->description->camera.width + 1, down = t->description->camera.height + 1;
#pragma omp parallel for schedule(dynamic)
  for (int row = 0; row < down; row++) {
    for (int column = 0; column < across; column++) {
      corners[(size_t)row * (size_t)across + (size_t)column] = look(t, column, row);
    }
  }
}

static clt_status trace(clt_view *view, const clt_scene_description *description, const clt_visibility *visibility,
                        clt_error *error) {
  clt_shown shown = {0};
  size_t corner_count = ((size_t)view->width + 1) * ((size_t)view->height + 1);
  glimpse *corners = clt_alloc(corner_count, sizeof *corners);
  clt_status status = clt_shown_init(&shown, description, visibility, error);
  if (status == CLT_OK && corners == NULL) {
    status = out_of_memory(description, error);
  }
  if (status == CLT_OK) {
    const tracer common = {.description = description, .visibility = visibility, .shown = &shown, .corners = corners};
    look_at_corners(&common, corners);
    bool fits = clt_weights_init(&view->pixels, view->width * view->height) && trace_rows(view, &common);
    status = fits ? CLT_OK : out_of_memory(description, error);
  }
  free(corners);
  clt_shown_finish(&shown);
  return status;
}

/* F as T has it: T is for drive above the panel's black. */
static clt_status keep_direct(clt_view *view, const clt_scene_description *description,
                              const clt_visibility *visibility, clt_error *error) {
  size_t values = (size_t)view->cells * (size_t)view->channels;
  clt_cells cells = {0};
  clt_status status = clt_cells_init(&cells, description, visibility, error);
  view->direct = clt_alloc(values, sizeof *view->direct);
  if (status == CLT_OK && view->direct == NULL) {
    status = out_of_memory(description, error);
  }
  for (size_t k = 0; k < values && status == CLT_OK; k++) {
    view->direct[k] = (float)((1.0 - description->projector.black) * cells.direct[k]);
  }
  clt_cells_finish(&cells);
  return status;
}

clt_status clt_view_init(clt_view *view, const clt_scene_description *description, clt_error *error) {
  double black = description->projector.black;
  *view = (clt_view){.width = description->camera.width,
                     .height = description->camera.height,
                     .cells = description->width * description->height,
                     .channels = description->channels,
                     .leak = black / (1.0 - black)};
  clt_visibility *visibility = NULL;
  clt_status status = clt_visibility_create(description->surfaces, description->surface_count, &visibility, error);
  if (status == CLT_OK) {
    status = trace(view, description, visibility, error);
  }
  if (status == CLT_OK) {
    status = keep_direct(view, description, visibility, error);
  }
  clt_visibility_destroy(visibility);
  return status;
}

void clt_view_finish(clt_view *view) {
  clt_weights_finish(&view->pixels);
  free(view->direct);
  *view = (clt_view){0};
}

size_t clt_view_bytes(const clt_view *view) {
  const clt_weights *pixels = &view->pixels;
  return ((size_t)pixels->rows + 1) * sizeof *pixels->start +
         pixels->room * (sizeof *pixels->element + sizeof *pixels->weight) +
         (size_t)view->cells * (size_t)view->channels * sizeof *view->direct;
}

void clt_view_add_indirect(const clt_view *view, const float *drive, float *radiance) {
  size_t values = (size_t)view->cells * (size_t)view->channels;
  for (size_t k = 0; k < values; k++) {
    radiance[values + k] = (float)((double)radiance[k] - (double)view->direct[k] * ((double)drive[k] + view->leak));
  }
}

/* Every channel of a pixel; the channels of the signal lie `image` values apart. */
static void form_pixel(const clt_view *view, const float *layers, size_t pixel, size_t image, float *radiance) {
  double sum[CLT_SIM_CHANNELS_MAX] = {0.0};
  for (int k = view->pixels.start[pixel]; k < view->pixels.start[pixel + 1]; k++) {
    const float *from = &layers[view->pixels.element[k]];
    for (int c = 0; c < view->channels; c++) {
      sum[c] += view->pixels.weight[k] * (double)from[c * view->cells];
    }
  }
  for (int c = 0; c < view->channels; c++) {
    radiance[(size_t)c * image + pixel] = (float)sum[c];
  }
}

void clt_view_form(const clt_view *view, const float *layers, int first, int last, clt_signal *signal) {
  size_t width = (size_t)view->width, image = width * (size_t)view->height;
#pragma omp parallel for schedule(static) if ((last - first) * view->width * view->channels > FEW_VALUES)
  for (int y = first; y < last; y++) {
    for (size_t pixel = (size_t)y * width; pixel < (size_t)(y + 1) * width; pixel++) {
      form_pixel(view, layers, pixel, image, signal->radiance);
    }
  }
}
