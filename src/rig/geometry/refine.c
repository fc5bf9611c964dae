#include "rig/geometry/refine.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"

enum {
  RADIUS_USUAL = 3,
  RADIUS_MAX = 20,
  WINDOW_MAX = (2 * RADIUS_MAX + 1) * (2 * RADIUS_MAX + 1),
  LAG = 4,
  PASSES = 2
};
enum { BINS = 4096, BINS_PER_PIXEL = 64 }; /* of the histogram of pitches, panel pixels */
#define STEEP 3.0                          /* times the usual pitch that a surface may have */
#define SLACK 1.0                          /* panel pixels that stripes are always uncertain to */
#define SIGMAS 3.0
#define SUPPORT 0.2 /* of the window */
#define REACH 2.5   /* panel pixels that a window reaches to each side */
#define FINE 0.34   /* pitch below which a panel pixel spans so many camera pixels that only its edges tell places */

/* What a pixel's window is made of, relative to the pixel. */
typedef struct window {
  int count;
  float u[WINDOW_MAX], v[WINDOW_MAX], x[WINDOW_MAX], y[WINDOW_MAX], weight[WINDOW_MAX];
} window;

typedef struct refiner {
  const clt_pixel_map *map;
  const float *variance;
  size_t pixels;
  int radius;
  /* Panel pixels that a surface may span to each neighbour. */
  float reach[2 * RADIUS_MAX + 1][2 * RADIUS_MAX + 1];
} refiner;

/* The plane's value at the pixel, and its variance (both axes together). */
typedef struct plane {
  double x, y, variance;
  bool found;
} plane;

/* Median pitch by a histogram over pairs of decoded pixels LAG apart in a row and in a column. */
static double measure_pitch(const clt_pixel_map *map) {
  long histogram[BINS] = {0}, total = 0, passed = 0;
  int width = map->width, height = map->height;
  for (int y = 0; y + LAG < height; y += LAG) {
    for (int x = 0; x + LAG < width; x++) {
      size_t i = (size_t)y * (size_t)width + (size_t)x, to[2] = {i + LAG, i + LAG * (size_t)width};
      for (int k = 0; k < 2 && map->fate[i] == CLT_PIXEL_DECODED; k++) {
        if (map->fate[to[k]] == CLT_PIXEL_DECODED) {
          double pitch = hypot(map->x[to[k]] - map->x[i], map->y[to[k]] - map->y[i]) / LAG;
          histogram[(int)fmin(pitch * BINS_PER_PIXEL, BINS - 1)]++;
          total++;
        }
      }
    }
  }
  for (int bin = 0; bin < BINS; bin++) {
    passed += histogram[bin];
    if (2 * passed > total) {
      return (bin + 0.5) / BINS_PER_PIXEL;
    }
  }
  return 1;
}

/* Neighbours that may lie on the pixel's surface. */
static void gather(const refiner *r, int px, int py, window *out) {
  const clt_pixel_map *map = r->map;
  size_t p = (size_t)py * (size_t)map->width + (size_t)px;
  out->count = 0;
  for (int v = -r->radius; v <= r->radius; v++) {
    for (int u = -r->radius; u <= r->radius; u++) {
      int x = px + u, y = py + v;
      if (x < 0 || y < 0 || x >= map->width || y >= map->height) {
        continue;
      }
      size_t n = (size_t)y * (size_t)map->width + (size_t)x;
      if (map->fate[n] != CLT_PIXEL_DECODED) {
        continue;
      }
      float dx = map->x[n] - map->x[p], dy = map->y[n] - map->y[p];
      float own = r->variance[n] + r->variance[r->pixels + n];
      float slack = (float)SLACK + (float)SIGMAS * sqrtf(own + r->variance[p] + r->variance[r->pixels + p]);
      float reach = slack + r->reach[v + RADIUS_MAX][u + RADIUS_MAX];
      if (dx * dx + dy * dy <= reach * reach) {
        int k = out->count++;
        out->u[k] = (float)u, out->v[k] = (float)v, out->x[k] = dx, out->y[k] = dy, out->weight[k] = 1 / own;
      }
    }
  }
}

/* Weighted least squares of x = a + b u + c v and of y: M [a b c] = m with M the moments of 1, u, v. */
static plane fit_plane(const window *w, float slope[2][2]) {
  double s = 0, su = 0, sv = 0, suu = 0, suv = 0, svv = 0, m[2][3] = {{0}};
  for (int k = 0; k < w->count; k++) {
    double q = w->weight[k], u = w->u[k], v = w->v[k], x = w->x[k], y = w->y[k];
    s += q, su += q * u, sv += q * v, suu += q * u * u, suv += q * u * v, svv += q * v * v;
    m[0][0] += q * x, m[0][1] += q * u * x, m[0][2] += q * v * x;
    m[1][0] += q * y, m[1][1] += q * u * y, m[1][2] += q * v * y;
  }
  double c0 = suu * svv - suv * suv, c1 = suv * sv - su * svv, c2 = su * suv - suu * sv;
  double determinant = s * c0 + su * c1 + sv * c2;
  if (!(determinant > 1e-9 * s * s * s)) {
    return (plane){.found = false};
  }
  double value[2];
  for (int a = 0; a < 2; a++) { /* rows of the symmetric inverse of M */
    value[a] = (c0 * m[a][0] + c1 * m[a][1] + c2 * m[a][2]) / determinant;
    slope[a][0] = (float)((c1 * m[a][0] + (s * svv - sv * sv) * m[a][1] + (su * sv - s * suv) * m[a][2]) / determinant);
    slope[a][1] = (float)((c2 * m[a][0] + (su * sv - s * suv) * m[a][1] + (s * suu - su * su) * m[a][2]) / determinant);
  }
  return (plane){value[0], value[1], c0 / determinant, true};
}

/* Squared distance of a window's pixel from the plane. */
static float off_plane(const window *w, int k, const plane *fit, float slope[2][2]) {
  float x = w->x[k] - (float)fit->x - slope[0][0] * w->u[k] - slope[0][1] * w->v[k];
  float y = w->y[k] - (float)fit->y - slope[1][0] * w->u[k] - slope[1][1] * w->v[k];
  return x * x + y * y;
}

/* Drops what lies off the plane; returns the mean of (squared distance / variance) of all that was there. */
static double drop_outliers(window *w, const plane *fit, float slope[2][2]) {
  double squares = 0;
  float distance[WINDOW_MAX];
  int kept = 0;
  for (int k = 0; k < w->count; k++) {
    distance[k] = off_plane(w, k, fit, slope);
    squares += distance[k] * w->weight[k];
  }
  double excess = squares / w->count;
  float limit = (float)(SIGMAS * SIGMAS * fmin(excess, 1) + 1e-12);
  for (int k = 0; k < w->count; k++) {
    if (distance[k] * w->weight[k] <= limit || distance[k] < 0.0625F) { /* a quarter of a pixel is always near */
      w->u[kept] = w->u[k], w->v[kept] = w->v[k], w->x[kept] = w->x[k], w->y[kept] = w->y[k];
      w->weight[kept++] = w->weight[k];
    }
  }
  w->count = kept;
  return excess;
}

static plane refine_pixel(const refiner *r, int x, int y) {
  window w;
  int side = 2 * r->radius + 1, fewest = (int)fmax(4, SUPPORT * side * side);
  gather(r, x, y, &w);
  plane fit = {.found = false};
  for (int pass = 0; pass < PASSES; pass++) {
    float slope[2][2];
    if (w.count < fewest) {
      return (plane){.found = false};
    }
    fit = fit_plane(&w, slope);
    if (!fit.found) {
      return fit;
    }
    double excess = drop_outliers(&w, &fit, slope);
    fit.variance *= fmax(excess, 1);
  }
  size_t p = (size_t)y * (size_t)r->map->width + (size_t)x;
  double own = (double)r->variance[p] + (double)r->variance[r->pixels + p];
  fit.found = hypot(fit.x, fit.y) <= SLACK + SIGMAS * sqrt(own);
  return fit;
}

static void refine_row(const refiner *r, int y, clt_pixel_map *out) {
  const clt_pixel_map *map = r->map;
  for (int x = 0; x < map->width; x++) {
    size_t i = (size_t)y * (size_t)map->width + (size_t)x;
    if (map->fate[i] != CLT_PIXEL_DECODED) {
      clt_pixel_map_mask(out, i, map->fate[i]);
      continue;
    }
    plane fit = refine_pixel(r, x, y);
    if (!fit.found) {
      clt_pixel_map_mask(out, i, CLT_PIXEL_ISOLATED);
      continue;
    }
    out->fate[i] = CLT_PIXEL_DECODED;
    out->x[i] = map->x[i] + (float)fit.x;
    out->y[i] = map->y[i] + (float)fit.y;
    out->confidence[i] = clt_pixel_confidence(fit.variance);
    bool inside =
        out->x[i] >= 0 && out->x[i] < (float)map->panel_width && out->y[i] >= 0 && out->y[i] < (float)map->panel_height;
    if (!inside) {
      clt_pixel_map_mask(out, i, CLT_PIXEL_OUTSIDE);
    }
  }
}

clt_status clt_pixel_map_refine(clt_pixel_map *map, const float *variance, double *pitch, clt_error *error) {
  clt_pixel_map refined;
  clt_status status = clt_pixel_map_init(&refined, map->width, map->height, map->panel_width, map->panel_height, error);
  if (status != CLT_OK) {
    return status;
  }
  *pitch = measure_pitch(map);
  refiner r = {.map = map, .variance = variance, .pixels = (size_t)map->width * (size_t)map->height};
  r.radius = (int)fmin(fmax(lround(REACH / *pitch), 1), *pitch < FINE ? RADIUS_MAX : RADIUS_USUAL);
  for (int v = -RADIUS_MAX; v <= RADIUS_MAX; v++) {
    for (int u = -RADIUS_MAX; u <= RADIUS_MAX; u++) {
      r.reach[v + RADIUS_MAX][u + RADIUS_MAX] = (float)(STEEP * *pitch * hypot(u, v));
    }
  }
#pragma omp parallel for schedule(dynamic, 8)
  for (int y = 0; y < map->height; y++) {
    refine_row(&r, y, &refined);
  }
  clt_pixel_map_finish(map);
  *map = refined;
  *pitch = measure_pitch(map); /* without the noise of single pixels */
  return CLT_OK;
}
