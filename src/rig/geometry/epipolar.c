#include "rig/geometry/epipolar.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"

enum { FEWEST = 100, FITTED_FROM = 20000 };

/* The decoded pixels. */
typedef struct points {
  size_t count;
  double *camera, *panel; /* x, y each; pixels, first pixel's centre at 0; normalised once undistorted */
  double *distance;       /* camera pixels */
  float *confidence;
} points;

static clt_status take_points(const clt_pixel_map *map, points *out, clt_error *error) {
  size_t pixels = (size_t)map->width * (size_t)map->height;
  *out = (points){.camera = clt_alloc(2 * pixels, sizeof(double)),
                  .panel = clt_alloc(2 * pixels, sizeof(double)),
                  .distance = clt_alloc(pixels, sizeof(double)),
                  .confidence = clt_alloc(pixels, sizeof(float))};
  if (out->camera == NULL || out->panel == NULL || out->distance == NULL || out->confidence == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the epipolar distances of %zu pixels", pixels);
  }
  for (size_t i = 0; i < pixels; i++) {
    if (map->fate[i] == CLT_PIXEL_DECODED) {
      double *camera = out->camera + 2 * out->count, *panel = out->panel + 2 * out->count;
      camera[0] = (double)(i % (size_t)map->width);
      camera[1] = (double)(i / (size_t)map->width);
      panel[0] = (double)map->x[i] - 0.5;
      panel[1] = (double)map->y[i] - 0.5;
      out->confidence[out->count++] = map->confidence[i];
    }
  }
  return out->count >= FEWEST ? CLT_OK
                              : clt_fail(error, CLT_BAD_INPUT,
                                         "only %zu camera pixels were decoded; check that the camera sees the picture, "
                                         "that it is lit, and the panel's size",
                                         out->count);
}

static void finish_points(points *p) {
  free(p->camera);
  free(p->panel);
  free(p->distance);
  free(p->confidence);
}

/* E = [t]x R, row by row. */
static void essential_of(const clt_stereo *stereo, double e[9]) {
  const double *t = stereo->translation, *r = stereo->rotation;
  for (int c = 0; c < 3; c++) {
    e[c] = t[1] * r[6 + c] - t[2] * r[3 + c];
    e[3 + c] = t[2] * r[c] - t[0] * r[6 + c];
    e[6 + c] = t[0] * r[3 + c] - t[1] * r[c];
  }
}

/* |p' E c| over the line's slope at c, in pixels of focal lengths fx and fy. */
static double distance_of(const double e[9], const double *camera, const double *panel, double fx, double fy) {
  double line[3];
  for (int c = 0; c < 3; c++) {
    line[c] = e[c] * panel[0] + e[3 + c] * panel[1] + e[6 + c];
  }
  return fabs(line[0] * camera[0] + line[1] * camera[1] + line[2]) / hypot(line[0] / fx, line[1] / fy);
}

/* The fundamental matrix of evenly chosen points. */
static clt_status fit(const points *p, double f[9], clt_error *error) {
  size_t step = p->count / FITTED_FROM + 1, count = 0;
  double *chosen = clt_alloc(4 * (p->count / step + 1), sizeof *chosen);
  if (chosen == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the points of the fundamental matrix");
  }
  double *panel = chosen + 2 * (p->count / step + 1);
  for (size_t i = 0; i < p->count; i += step, count++) {
    for (int k = 0; k < 2; k++) {
      chosen[2 * count + (size_t)k] = p->camera[2 * i + (size_t)k];
      panel[2 * count + (size_t)k] = p->panel[2 * i + (size_t)k];
    }
  }
  clt_status status = clt_fundamental_fit(chosen, panel, count, f, error);
  free(chosen);
  return status;
}

/* The pixels that a lens of the same focal length and centre, but straight, would see. */
static clt_status straighten(points *p, const clt_lens *lens, clt_error *error) {
  clt_status status = clt_lens_undistort(lens, p->camera, p->count, error);
  for (size_t i = 0; i < p->count; i++) {
    p->camera[2 * i] = lens->fx * p->camera[2 * i] + lens->cx;
    p->camera[2 * i + 1] = lens->fy * p->camera[2 * i + 1] + lens->cy;
  }
  return status;
}

static clt_status measure(points *p, const clt_stereo *reference, const clt_lens *lens, clt_error *error) {
  double e[9], fx = 1, fy = 1;
  clt_status status;
  if (reference != NULL) {
    essential_of(reference, e);
    fx = reference->camera.fx;
    fy = reference->camera.fy;
    status = clt_lens_undistort(&reference->camera, p->camera, p->count, error);
    if (status == CLT_OK) {
      status = clt_lens_undistort(&reference->projector, p->panel, p->count, error);
    }
  } else {
    status = lens != NULL ? straighten(p, lens, error) : CLT_OK;
    status = status == CLT_OK ? fit(p, e, error) : status;
  }
  for (size_t i = 0; status == CLT_OK && i < p->count; i++) {
    p->distance[i] = distance_of(e, p->camera + 2 * i, p->panel + 2 * i, fx, fy);
  }
  return status;
}

/* Median and 90th percentile of the distances of pixels of at least some confidence; panel is free to hold them. */
static long summarise(points *p, float least, double *median, double *upper) {
  size_t count = 0;
  for (size_t i = 0; i < p->count; i++) {
    if (p->confidence[i] >= least) {
      p->panel[count++] = p->distance[i];
    }
  }
  clt_sort_doubles(p->panel, count);
  *median = p->panel[count / 2];
  *upper = p->panel[(size_t)(0.9 * (double)(count - 1))];
  return (long)count;
}

clt_status clt_epipolar_check(const clt_pixel_map *map, const clt_stereo *reference, const clt_lens *lens,
                              clt_epipolar *out, clt_error *error) {
  points p;
  *out = (clt_epipolar){.fitted = reference == NULL}; /* count stays 0 on failure */
  clt_status status = take_points(map, &p, error);
  if (status == CLT_OK) {
    status = measure(&p, reference, lens, error);
  }
  if (status == CLT_OK) {
    out->count = summarise(&p, 0, &out->median, &out->upper);
    float *sorted = (float *)p.camera; /* no longer needed */
    for (size_t i = 0; i < p.count; i++) {
      sorted[i] = p.confidence[i];
    }
    clt_sort_floats(sorted, p.count);
    out->sure = summarise(&p, sorted[p.count / 2], &out->sure_median, &out->sure_upper);
  }
  finish_points(&p);
  return status;
}
