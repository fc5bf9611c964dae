#include "rig/geometry/refine.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum {
  RADIUS_USUAL = 3,
  RADIUS_MAX = 20,
  WINDOW_MAX = (2 * RADIUS_MAX + 1) * (2 * RADIUS_MAX + 1),
  LAG = 4,
  PASSES = 2,
  TERMS = 6
};
enum { BINS = 4096, BINS_PER_PIXEL = 64 }; /* of the histogram of pitches, panel pixels */
#define STEEP 3.0                          /* times the usual pitch that a surface may have */
#define SLACK 1.0                          /* panel pixels that stripes are always uncertain to */
#define SIGMAS 3.0
#define SUPPORT 0.2  /* of the window */
#define REACH 2.5    /* panel pixels that a window reaches to each side */
#define TROUBLED 1.5 /* excess from which a window is taken to hold two surfaces */
#define BETTER 0.5   /* of the risk that a window beside the pixel must have */
#define FINE 0.34    /* pitch below which a panel pixel spans so many camera pixels that only its edges tell places */

/* What a pixel's window is made of, relative to the pixel. */
typedef struct window {
  int count;
  float u[WINDOW_MAX], v[WINDOW_MAX], at[2][WINDOW_MAX], weight[2][WINDOW_MAX]; /* x and y, 1 / variance */
} window;

typedef struct refiner {
  const clt_pixel_map *map;
  const float *variance;
  size_t pixels;
  int radius;
  /* Panel pixels that a surface may span to each neighbour. */
  float reach[2 * RADIUS_MAX + 1][2 * RADIUS_MAX + 1];
} refiner;

/* A coordinate as a polynomial of the place in a window, relative to its middle: 1, u, v, and of wide windows u^2, uv,
 * v^2. */
typedef struct surface {
  int terms;
  double at[TERMS];
  double factor[TERMS][TERMS]; /* L of M = L L', M the weighted moments of the terms */
  double excess;               /* mean of (squared distance from the surface / variance) */
  double spread;               /* mean variance of what it rests on */
} surface;

/* Values of x and y at a pixel, relative to the pixel's own, their variances together, and the squared error to be
 * expected of them. */
typedef struct value {
  double at[2], variance, risk;
  bool found;
} value;

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
        out->u[k] = (float)u, out->v[k] = (float)v, out->at[0][k] = dx, out->at[1][k] = dy;
        out->weight[0][k] = 1 / r->variance[n], out->weight[1][k] = 1 / r->variance[r->pixels + n];
      }
    }
  }
}

static void terms_at(double u, double v, double t[TERMS]) {
  t[0] = 1, t[1] = u, t[2] = v, t[3] = u * u, t[4] = u * v, t[5] = v * v;
}

/* Cholesky's factor in place, lower half; false where M is singular. */
static bool factorise(double m[TERMS][TERMS], int n) {
  for (int i = 0; i < n; i++) {
    for (int j = 0; j <= i; j++) {
      double sum = m[i][j];
      for (int k = 0; k < j; k++) {
        sum -= m[i][k] * m[j][k];
      }
      if (i == j && !(sum > 1e-9 * m[0][0])) {
        return false;
      }
      m[i][j] = i == j ? sqrt(sum) : sum / m[j][j];
    }
  }
  return true;
}

/* L z = b in place; b' M^-1 b is then |z|^2. */
static void solve_lower(double l[TERMS][TERMS], int n, double *b) {
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < i; k++) {
      b[i] -= l[i][k] * b[k];
    }
    b[i] /= l[i][i];
  }
}

static void solve_upper(double l[TERMS][TERMS], int n, double *b) {
  for (int i = n - 1; i >= 0; i--) {
    for (int k = i + 1; k < n; k++) {
      b[i] -= l[k][i] * b[k];
    }
    b[i] /= l[i][i];
  }
}

/* Weighted least squares. */
static bool fit_surface(const window *w, int axis, surface *s) {
  int n = s->terms;
  double t[TERMS];
  memset(s->factor, 0, sizeof s->factor);
  memset(s->at, 0, sizeof s->at);
  for (int k = 0; k < w->count; k++) {
    double q = w->weight[axis][k];
    terms_at(w->u[k], w->v[k], t);
    for (int i = 0; i < n; i++) {
      for (int j = 0; j <= i; j++) {
        s->factor[i][j] += q * t[i] * t[j];
      }
      s->at[i] += q * t[i] * w->at[axis][k];
    }
  }
  s->spread = w->count / s->factor[0][0];
  if (!factorise(s->factor, n)) {
    return false;
  }
  solve_lower(s->factor, n, s->at);
  solve_upper(s->factor, n, s->at);
  return true;
}

static double sum_terms(const double *c, const double *t, int n) {
  double sum = 0;
  for (int k = 0; k < n; k++) {
    sum += c[k] * t[k];
  }
  return sum;
}

/* Drops what lies off the surfaces; measures the excess of all that was there. */
static void drop_outliers(window *w, surface s[2]) {
  float off[2][WINDOW_MAX], limit[2];
  int kept = 0;
  for (int a = 0; a < 2; a++) {
    double squares = 0, t[TERMS];
    for (int k = 0; k < w->count; k++) {
      terms_at(w->u[k], w->v[k], t);
      off[a][k] = (float)pow(w->at[a][k] - sum_terms(s[a].at, t, s[a].terms), 2);
      squares += off[a][k] * w->weight[a][k];
    }
    s[a].excess = squares / w->count;
    limit[a] = (float)(SIGMAS * SIGMAS * fmin(s[a].excess, 1) + 1e-12);
  }
  for (int k = 0; k < w->count; k++) {
    bool on = off[0][k] * w->weight[0][k] <= limit[0] && off[1][k] * w->weight[1][k] <= limit[1];
    if (on || off[0][k] + off[1][k] < 0.0625F) { /* a quarter of a pixel is always near */
      w->u[kept] = w->u[k], w->v[kept] = w->v[k];
      for (int a = 0; a < 2; a++) {
        w->at[a][kept] = w->at[a][k], w->weight[a][kept] = w->weight[a][k];
      }
      kept++;
    }
  }
  w->count = kept;
}

/* The surfaces of x and y through the window around a pixel. */
static bool find_surfaces(const refiner *r, int x, int y, surface s[2]) {
  window w;
  int side = 2 * r->radius + 1, fewest = (int)fmax(4, SUPPORT * side * side);
  gather(r, x, y, &w);
  s[0].terms = s[1].terms = r->radius > RADIUS_USUAL ? TERMS : 3;
  for (int pass = 0; pass < PASSES; pass++) {
    if (w.count < fewest || !fit_surface(&w, 0, &s[0]) || !fit_surface(&w, 1, &s[1])) {
      return false;
    }
    drop_outliers(&w, s);
  }
  return true;
}

/* Their values at (u, v) from the window's middle, whose own coordinates are x and y from the pixel's. */
static value value_of(surface s[2], double u, double v, double x, double y) {
  value out = {.at = {x, y}, .found = true};
  for (int a = 0; a < 2; a++) {
    double t[TERMS];
    terms_at(u, v, t);
    out.at[a] += sum_terms(s[a].at, t, s[a].terms);
    solve_lower(s[a].factor, s[a].terms, t);
    out.variance += sum_terms(t, t, s[a].terms) * fmax(s[a].excess, 1);
    out.risk += fmax(s[a].excess - 1, 0) * s[a].spread;
  }
  out.risk += out.variance;
  return out;
}

/* The least risky surface of the windows that have the pixel at their edge; at edges in depth and creases the pixel's
 * own window holds two surfaces, and one beside it a single one. limit: distance from the pixel's own coordinates. */
static void look_beside(const refiner *r, int x, int y, double limit, value *best) {
  static const int around[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
  const clt_pixel_map *map = r->map;
  size_t p = (size_t)y * (size_t)map->width + (size_t)x;
  for (int k = 0; k < 8; k++) {
    surface s[2];
    int u = around[k][0] * r->radius, v = around[k][1] * r->radius, qx = x + u, qy = y + v;
    size_t q = (size_t)qy * (size_t)map->width + (size_t)qx;
    if (qx < 0 || qy < 0 || qx >= map->width || qy >= map->height || map->fate[q] != CLT_PIXEL_DECODED ||
        !find_surfaces(r, qx, qy, s)) {
      continue;
    }
    double dx = (double)map->x[q] - (double)map->x[p], dy = (double)map->y[q] - (double)map->y[p];
    value there = value_of(s, -u, -v, dx, dy);
    if (there.risk < best->risk && hypot(there.at[0], there.at[1]) <= limit) {
      *best = there;
    }
  }
}

static value refine_pixel(const refiner *r, int x, int y) {
  size_t p = (size_t)y * (size_t)r->map->width + (size_t)x;
  double own = (double)r->variance[p] + (double)r->variance[r->pixels + p], limit = SLACK + SIGMAS * sqrt(own);
  surface s[2];
  value best = {.found = false};
  if (!find_surfaces(r, x, y, s)) {
    return best;
  }
  best = value_of(s, 0, 0, 0, 0);
  best.risk *= BETTER;
  if (fmax(s[0].excess, s[1].excess) >= TROUBLED) {
    look_beside(r, x, y, limit, &best);
  }
  best.found = hypot(best.at[0], best.at[1]) <= limit;
  return best;
}

static void refine_row(const refiner *r, int y, clt_pixel_map *out) {
  const clt_pixel_map *map = r->map;
  for (int x = 0; x < map->width; x++) {
    size_t i = (size_t)y * (size_t)map->width + (size_t)x;
    if (map->fate[i] != CLT_PIXEL_DECODED) {
      clt_pixel_map_mask(out, i, map->fate[i]);
      continue;
    }
    value fit = refine_pixel(r, x, y);
    if (!fit.found) {
      clt_pixel_map_mask(out, i, CLT_PIXEL_ISOLATED);
      continue;
    }
    out->fate[i] = CLT_PIXEL_DECODED;
    out->x[i] = map->x[i] + (float)fit.at[0];
    out->y[i] = map->y[i] + (float)fit.at[1];
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
