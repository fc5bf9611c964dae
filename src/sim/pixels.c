/* What is told about a camera with pixels of its own. */
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"
#include "sim/state.h"

/* The shortest time of a few in which the image is formed from light that is there. */
static clt_status measure(const clt_view *view, double *frame_ms, clt_error *error) {
  enum { RUNS = 3 };
  size_t values = (size_t)view->cells * (size_t)view->channels;
  size_t samples = (size_t)view->width * (size_t)view->height * (size_t)view->channels;
  float *layers = clt_alloc(CLT_VIEW_LAYERS * values + samples, sizeof *layers);
  if (layers == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for an image of %d x %d pixels", view->width, view->height);
  }
  clt_signal signal = {.width = view->width,
                       .height = view->height,
                       .channels = view->channels,
                       .radiance = layers + CLT_VIEW_LAYERS * values};
  *frame_ms = INFINITY;
  for (int n = 0; n < RUNS; n++) {
    int64_t start_ns = clt_clock_ns();
    clt_view_form(view, layers, 0, view->height, &signal);
    *frame_ms = fmin(*frame_ms, 1e3 * clt_clock_since(start_ns));
  }
  free(layers);
  return CLT_OK;
}

clt_status clt_scene_pixels(const clt_scene *scene, clt_pixels_report *report, clt_error *error) {
  const clt_view *view = &scene->view;
  *report = (clt_pixels_report){.own = scene->description.camera.own_pixels};
  if (!report->own) {
    return CLT_OK;
  }
  report->lit = view->share[CLT_SIGHTLINE_LIT];
  report->shadowed = view->share[CLT_SIGHTLINE_SHADOWED];
  report->outside = view->share[CLT_SIGHTLINE_OUTSIDE];
  report->nothing = view->share[CLT_SIGHTLINE_NOTHING];
  report->prepare_ms = scene->view_ms;
  report->bytes = clt_view_bytes(view);
  return measure(view, &report->frame_ms, error);
}

clt_status clt_scene_pixel_map(const clt_scene *scene, clt_image *map, clt_error *error) {
  const clt_camera_description *camera = &scene->description.camera;
  if (!camera->own_pixels) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "%s: the camera's pixels are the grid's, %d x %d a cell: there is no map of them; give it pixels of "
        "its own by pixels = [width, height]",
        scene->description.path, camera->cell_pixels, camera->cell_pixels);
  }
  clt_status status = clt_image_init(map, 3, camera->height, camera->width, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t image = (size_t)camera->width * (size_t)camera->height;
  status = clt_sightline_map(&scene->description, map->data, map->data + image, map->data + 2 * image, error);
  if (status != CLT_OK) {
    clt_image_finish(map);
  }
  return status;
}
