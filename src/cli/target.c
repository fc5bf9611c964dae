/* The picture that the demo projects when it is given none: drawn at several samples a cell, then averaged. */
#include "cli/target.h"

#include <math.h>

typedef struct colour {
  double r, g, b; /* linear light, 0..1 */
} colour;
typedef struct point {
  double x, y; /* 0 in the middle, one unit is the picture's height; 0 (top) .. 1 (bottom) */
} point;

enum { SAMPLES = 4 }; /* a cell, in each direction */
static const double horizon = 0.66;
static const point sun = {-0.36, 0.40};
static const colour sun_light = {1.0, 0.90, 0.52}, lamp_light = {1.0, 0.62, 0.16};

static colour mix(colour a, colour b, double t) {
  t = t < 0 ? 0 : t > 1 ? 1 : t;
  return (colour){a.r + t * (b.r - a.r), a.g + t * (b.g - a.g), a.b + t * (b.b - a.b)};
}

static colour add(colour a, colour b, double weight) {
  return (colour){a.r + weight * b.r, a.g + weight * b.g, a.b + weight * b.b};
}

/* 0 outside, 1 inside, over a soft edge. */
static double inside(double distance, double radius, double edge) {
  double t = 0.5 - (distance - radius) / edge;
  return t < 0 ? 0 : t > 1 ? 1 : t;
}

static colour sky(point p) {
  static const colour zenith = {0.05, 0.07, 0.26}, violet = {0.27, 0.10, 0.36}, rim = {0.95, 0.36, 0.14};
  double t = p.y / horizon;
  colour c = t < 0.55 ? mix(zenith, violet, t / 0.55) : mix(violet, rim, (t - 0.55) / 0.45);
  double away = hypot(p.x - sun.x, p.y - sun.y);
  c = add(c, sun_light, 0.55 * exp(-away * away / 0.035));
  return mix(c, sun_light, inside(away, 0.145, 0.02));
}

static colour sea(point p) {
  static const colour stripes[] = {{0.06, 0.46, 0.52}, {0.62, 0.09, 0.22}, {0.07, 0.18, 0.60}, {0.78, 0.32, 0.08}};
  static const colour deep = {0.05, 0.09, 0.17};
  double depth = (p.y - horizon) / (1 - horizon);
  double wave = depth + 0.02 * sin(9 * p.x + 4 * depth);
  double band = 6 * sqrt(wave > 0 ? wave : 0);
  colour c = mix(deep, stripes[(int)band & 3], fmod(band, 1) < 0.62 ? 0.9 : 0.12);
  double glitter = exp(-pow((p.x - sun.x) / (0.07 + 0.16 * depth), 2));
  return mix(c, sun_light, 0.85 * glitter * (fmod(band, 1) < 0.62));
}

/* The hillside on the right that hides sky and sea: its upper edge at x. */
static double hill_top(double x) {
  double rise = x < 0.02 ? 0 : 1 - exp(-pow((x - 0.02) / 0.34, 2));
  return 1.04 - 0.60 * rise + 0.015 * sin(17 * x);
}

static double segment_distance(point p, point a, point b) {
  double dx = b.x - a.x, dy = b.y - a.y;
  double t = ((p.x - a.x) * dx + (p.y - a.y) * dy) / (dx * dx + dy * dy);
  t = t < 0 ? 0 : t > 1 ? 1 : t;
  return hypot(p.x - a.x - t * dx, p.y - a.y - t * dy);
}

/* A lighthouse on the hill, striped, with a lamp. */
static colour lighthouse(point p, colour behind) {
  static const point foot = {0.46, 0.62}, top = {0.46, 0.26}, lamp = {0.46, 0.19};
  static const colour wall = {0.82, 0.80, 0.78}, red = {0.72, 0.07, 0.08}, roof = {0.05, 0.05, 0.07};
  colour c = add(behind, lamp_light, 0.35 * exp(-pow(hypot(p.x - lamp.x, p.y - lamp.y) / 0.10, 2)));
  double width = 0.045 + 0.03 * (p.y - top.y) / (foot.y - top.y);
  double stripe = fmod((p.y - top.y) / 0.12, 1);
  c = mix(c, stripe < 0.5 ? red : wall, inside(segment_distance(p, foot, top), width, 0.02));
  c = mix(c, roof, inside(segment_distance(p, (point){0.43, 0.135}, (point){0.49, 0.135}), 0.028, 0.02));
  return mix(c, lamp_light, inside(hypot(p.x - lamp.x, p.y - lamp.y), 0.042, 0.02));
}

static colour shade(point p) {
  static const colour rock = {0.050, 0.044, 0.075};
  colour c = p.y < horizon ? sky(p) : sea(p);
  c = lighthouse(p, c);
  return mix(c, rock, inside(hill_top(p.x) - p.y, 0, 0.02));
}

static float unit(double value) {
  return (float)(value < 0 ? 0 : value > 1 ? 1 : value);
}

static void draw(clt_image *image) {
  size_t cells = (size_t)image->width * (size_t)image->height;
  /* the composition needs this much width; a narrower or wider grid squeezes or stretches it */
  double span = fmin(fmax((double)image->width / image->height, 1.2), 1.6);
  for (int row = 0; row < image->height; row++) {
    for (int column = 0; column < image->width; column++) {
      colour c = shade((point){((column + 0.5) / image->width - 0.5) * span, (row + 0.5) / image->height});
      size_t at = (size_t)row * (size_t)image->width + (size_t)column;
      image->data[at] = unit(c.r);
      image->data[cells + at] = unit(c.g);
      image->data[2 * cells + at] = unit(c.b);
    }
  }
}

clt_status cli_target_draw(const cli_grid *grid, clt_image *out, clt_error *error) {
  clt_image fine = {0}, averaged = {0};
  clt_status status = clt_image_init(&fine, 3, SAMPLES * grid->height, SAMPLES * grid->width, error);
  if (!status) {
    draw(&fine);
    status = clt_image_resize(&fine, grid->height, grid->width, &averaged, error);
  }
  if (!status) {
    status = clt_image_convert(&averaged, grid->channels, out, error);
  }
  clt_image_finish(&fine);
  clt_image_finish(&averaged);
  return status;
}
