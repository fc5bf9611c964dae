#include "room.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { COLOURS = 3 };

static clt_status reserve(room *of, int width, int height, clt_error *error) {
  size_t values = (size_t)of->grid.channels * of->grid.cols;
  clt_status status = clt_image_init(&of->light, COLOURS, height, width, error);
  of->drive = calloc(values, sizeof *of->drive);
  of->radiance = calloc(values, sizeof *of->radiance);
  of->own = calloc(values, sizeof *of->own);
  of->pixels = calloc((size_t)of->width * of->height, sizeof *of->pixels);
  if (status == CLT_OK && (of->drive == NULL || of->radiance == NULL || of->own == NULL || of->pixels == NULL)) {
    status = clt_fail(error, CLT_FAILED, "not enough memory for the light of %zu cells", of->grid.cols);
  }
  return status;
}

/* What a pixel sees at one of its quarters, by the map's slope to its neighbours; map[0], map[1]: x and y, in cells. */
static uint32_t find_point(const room *of, const float *map[2], size_t p, int quarter) {
  size_t pixels = (size_t)of->width * of->height;
  int size[2] = {of->light.width, of->light.height}, cells[2] = {of->grid.width, of->grid.height}, at[2];
  for (int axis = 0; axis < 2; axis++) {
    float here = map[axis][p];
    float right = p + 1 < pixels ? map[axis][p + 1] - here : 0,
          down = p + of->width < pixels ? map[axis][p + of->width] - here : 0;
    float step = (quarter % 2 ? 0.25F : -0.25F) * (fabsf(right) < 1 ? right : 0) +
                 (quarter / 2 ? 0.25F : -0.25F) * (fabsf(down) < 1 ? down : 0);
    float place = (here + step) * (float)size[axis] / (float)cells[axis];
    at[axis] = place < 0 ? 0 : place >= (float)size[axis] ? size[axis] - 1 : (int)place;
  }
  return (uint32_t)(at[1] * size[0] + at[0]);
}

static void fill_pixels(room *of, const clt_image *map) {
  size_t pixels = (size_t)of->width * of->height;
  const float *place[2] = {map->data, map->data + pixels}, *kind = map->data + 2 * pixels;
  for (size_t p = 0; p < pixels; p++) {
    camera_pixel *pixel = &of->pixels[p];
    pixel->lit = kind[p] == 1;
    pixel->cell = pixel->lit ? (uint32_t)place[1][p] * (uint32_t)of->grid.width + (uint32_t)place[0][p] : 0;
    for (int quarter = 0; pixel->lit && quarter < CAMERA_POINTS; quarter++) {
      pixel->point[quarter] = find_point(of, place, p, quarter);
    }
  }
}

/* Everything but what the camera sees. */
static clt_status light_scene(room *of, int screen_width, int screen_height, clt_error *error) {
  clt_rig_config rig = {0};
  clt_scene_rig_config(of->scene, &rig);
  of->panel = rig.projector;
  of->transport = clt_scene_transport(of->scene);
  of->grid = clt_transport_describe(of->transport);
  if (of->grid.channels != COLOURS || screen_width % of->grid.width != 0 || screen_height % of->grid.height != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "a screen of %d x %d pixels is no multiple of the scene's %d x %d cells",
                    screen_width, screen_height, of->grid.width, of->grid.height);
  }
  clt_status status = reserve(of, screen_width, screen_height, error);
  for (int c = 0; status == CLT_OK && c < COLOURS; c++) {
    clt_transport_diagonal(of->transport, c, of->own + (size_t)c * of->grid.cols);
  }
  return status;
}

clt_status room_open(const char *scene, int screen_width, int screen_height, room *out, clt_error *error) {
  clt_image map = {0};
  *out = (room){0};
  clt_status status = clt_scene_open(scene, &out->scene, error);
  status = status == CLT_OK ? clt_scene_pixel_map(out->scene, &map, error) : status;
  if (status == CLT_OK) {
    out->width = (uint32_t)map.width;
    out->height = (uint32_t)map.height;
    status = light_scene(out, screen_width, screen_height, error);
  }
  if (status == CLT_OK) {
    fill_pixels(out, &map);
  }
  clt_image_finish(&map);
  return status;
}

void room_close(room *of) {
  clt_scene_close(of->scene);
  clt_image_finish(&of->light);
  free(of->drive);
  free(of->radiance);
  free(of->own);
  free(of->pixels);
}

/* Codes of the screen to linear light. */
static clt_status decode(room *of, const uint8_t *bgrx, clt_error *error) {
  size_t pixels = (size_t)of->light.width * (size_t)of->light.height;
  clt_image codes = {0};
  clt_status status = clt_image_init(&codes, COLOURS, of->light.height, of->light.width, error);
  if (status != CLT_OK) {
    return status;
  }
  for (size_t p = 0; p < pixels; p++) {
    for (size_t c = 0; c < COLOURS; c++) {
      codes.data[c * pixels + p] = (float)bgrx[4 * p + 2 - c] / 255;
    }
  }
  clt_image_finish(&of->light);
  status = clt_panel_decode(&of->panel, &codes, &of->light, error);
  clt_image_finish(&codes);
  return status;
}

/* The mean of a channel's light over each cell. */
static void gather(const room *of, size_t c, double *drive) {
  size_t width = (size_t)of->light.width, height = (size_t)of->light.height;
  size_t across = width / (size_t)of->grid.width, down = height / (size_t)of->grid.height;
  memset(drive, 0, of->grid.cols * sizeof *drive);
  for (size_t y = 0; y < height; y++) {
    const float *row = of->light.data + (c * height + y) * width;
    for (size_t x = 0; x < width; x++) {
      drive[y / down * (size_t)of->grid.width + x / across] += (double)row[x] / (double)(across * down);
    }
  }
}

clt_status room_light(room *of, const uint8_t *bgrx, clt_error *error) {
  clt_status status = decode(of, bgrx, error);
  for (size_t c = 0; status == CLT_OK && c < COLOURS; c++) {
    double *drive = of->drive + c * of->grid.cols, *radiance = of->radiance + c * of->grid.cols;
    const float *black = clt_transport_black(of->transport, (int)c);
    gather(of, c, drive);
    clt_transport_apply(of->transport, (int)c, drive, radiance);
    for (size_t i = 0; i < of->grid.cols && black != NULL; i++) {
      radiance[i] += (double)black[i];
    }
  }
  return status;
}

void room_view(const room *of, float *picture) {
  size_t pixels = (size_t)of->width * of->height, points = (size_t)of->light.width * (size_t)of->light.height;
  for (size_t p = 0; p < pixels; p++) {
    const camera_pixel *pixel = &of->pixels[p];
    for (size_t c = 0; c < COLOURS; c++) {
      const float *light = of->light.data + c * points;
      size_t at = c * of->grid.cols + pixel->cell;
      double own = 0;
      for (int k = 0; k < CAMERA_POINTS; k++) {
        own += (double)light[pixel->point[k]] / CAMERA_POINTS;
      }
      picture[COLOURS * p + c] =
          pixel->lit ? (float)fmax(of->radiance[at] + of->own[at] * (own - of->drive[at]), 0) : 0;
    }
  }
}

clt_status room_save(const room *of, const char *path, clt_error *error) {
  clt_image image = {0};
  clt_status status = clt_image_init(&image, COLOURS, of->grid.height, of->grid.width, error);
  for (size_t i = 0; status == CLT_OK && i < clt_image_size(&image); i++) {
    image.data[i] = (float)of->radiance[i];
  }
  status = status == CLT_OK ? clt_image_write(path, NULL, &image, error) : status;
  clt_image_finish(&image);
  return status;
}
