/* A panel's patterns as a camera sees them, from first principles: places on the panel by a projective map with
 * distortion, blur as a Gaussian over the panel, a pixel's light as the mean over its area, light from elsewhere,
 * photon and read noise, quantisation. Shares no code with the decoder beside the patterns' definition. */
#ifndef CLT_TESTS_RIG_STRUCTURED_H
#define CLT_TESTS_RIG_STRUCTURED_H

#include <stdbool.h>

#include "rig/geometry/pairs.h"
#include "support.h"

enum {
  SEEN_WIDTH = 208,
  SEEN_HEIGHT = 156,
  SEEN_PIXELS = SEEN_WIDTH * SEEN_HEIGHT,
  PANEL_WIDTH = 240,
  PANEL_HEIGHT = 150
};

typedef struct seen_scene {
  double pitch;     /* panel pixels from camera pixel to camera pixel */
  double turn;      /* of the camera about its axis, radians */
  double tilt;      /* perspective: change of the pitch over the picture */
  double bend;      /* distortion */
  double step;      /* panel pixels that the right part's places are shifted by: a second surface */
  double shadow;    /* share of the picture's width, in its middle, without direct light */
  double mirror;    /* light of a second place, over the direct light, in the lower half */
  double blur;      /* standard deviation, panel pixels */
  double indirect;  /* light of the whole panel's mean, over the direct light of white */
  double light;     /* of a lit white surface, over full scale */
  double drift;     /* growth of the exposure from the first frame to the last */
  double electrons; /* full well; 0: no noise */
  int bits, channels;
  bool srgb;
  uint64_t seed;
} seen_scene;

/* Where on the panel a point of the camera's picture lies; pixel centres are whole numbers. */
static inline void seen_place(const seen_scene *s, double u, double v, bool second, double *x, double *y) {
  double a = (u - SEEN_WIDTH / 2.0) / SEEN_WIDTH, b = (v - SEEN_HEIGHT / 2.0) / SEEN_WIDTH;
  double c = cos(s->turn), d = sin(s->turn), r = 1 + s->bend * (a * a + b * b), w = 1 + s->tilt * a - 0.5 * s->tilt * b;
  double p = s->pitch * SEEN_WIDTH * r / w;
  *x = PANEL_WIDTH / 2.0 + p * (c * a - d * b) + (s->step != 0 && u > 0.6 * SEEN_WIDTH ? s->step : 0);
  *y = PANEL_HEIGHT / 2.0 + p * (d * a + c * b);
  if (second) {
    *x = PANEL_WIDTH - *x + 7.3;
    *y = *y + 21.6;
  }
}

static inline double seen_albedo(double u, double v) {
  return 0.7 + 0.2 * sin(0.11 * u + 0.05 * v) + 0.1 * sin(0.61 * v - 0.13 * u);
}

static inline bool seen_shadowed(const seen_scene *s, double u) {
  return fabs(u / SEEN_WIDTH - 0.3) < 0.5 * s->shadow;
}

/* Light at a panel coordinate of a picture: each pixel's box, blurred, by erf; dark beyond the panel. */
static inline double seen_profile(const clt_gray *gray, int index, double blur, double at, int size) {
  clt_gray_picture picture = clt_gray_picture_at(gray, index);
  int reach = (int)ceil(5 * blur) + 1, first = (int)floor(at) - reach;
  double sum = 0;
  for (int k = first; k <= first + 2 * reach; k++) {
    if (k >= 0 && k < size && (((k ^ k >> 1) >> picture.bit & 1) != 0) != picture.inverse) {
      sum += 0.5 * (erf((k + 1 - at) / (M_SQRT2 * blur)) - erf((k - at) / (M_SQRT2 * blur)));
    }
  }
  return sum;
}

/* Share of a point's light that the panel's border leaves, across the stripes. */
static inline double seen_inside(double at, int size, double blur) {
  if (at > 6 * blur && at < size - 6 * blur) {
    return 1;
  }
  return 0.5 * (erf((size - at) / (M_SQRT2 * blur)) - erf((0 - at) / (M_SQRT2 * blur)));
}

enum { SEEN_FINE = 32, SEEN_MARGIN = 64, SEEN_TABLE = (PANEL_WIDTH + 2 * SEEN_MARGIN) * SEEN_FINE };

/* seen_profile over the panel's axis, in steps of 1 / SEEN_FINE pixels. */
static inline void seen_fill(const seen_scene *s, const clt_gray *gray, int index, double table[SEEN_TABLE]) {
  int size = clt_gray_picture_at(gray, index).axis == 1 ? PANEL_HEIGHT : PANEL_WIDTH;
  for (int k = 0; k < SEEN_TABLE; k++) {
    table[k] = seen_profile(gray, index, s->blur, (k + 0.5) / SEEN_FINE - SEEN_MARGIN, size);
  }
}

static inline double seen_look_up(const double table[SEEN_TABLE], double at) {
  double k = (at + SEEN_MARGIN) * SEEN_FINE - 0.5, low = floor(k);
  return low < 0 || low >= SEEN_TABLE - 1 ? 0 : table[(int)low] + (k - low) * (table[(int)low + 1] - table[(int)low]);
}

/* Direct light of a picture in a camera pixel: mean over 3 x 3 points of its area. */
static inline double seen_direct(const seen_scene *s, bool rows, const double *table, int u, int v, bool second) {
  double sum = 0;
  for (int k = 0; k < 9; k++) {
    double x, y, du = (k % 3 - 1) / 3.0, dv = (k / 3 - 1) / 3.0;
    seen_place(s, u + du, v + dv, second, &x, &y);
    double along = rows ? seen_inside(x, PANEL_WIDTH, s->blur) : seen_inside(y, PANEL_HEIGHT, s->blur);
    sum += along * seen_look_up(table, rows ? y : x) / 9;
  }
  return sum;
}

static inline double seen_normal(uint64_t *random) {
  double a = test_random(random), b = test_random(random);
  return sqrt(-2 * log(a + 1e-300)) * cos(2 * M_PI * b);
}

static inline double seen_encode_srgb(double v) {
  return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

/* The frame of a picture. samples has room for SEEN_PIXELS * channels. */
static inline clt_frame seen_frame(const seen_scene *s, const clt_gray *gray, int index, uint16_t *samples) {
  static const double tint[3] = {1, 0.8, 0.6};
  int full = (1 << s->bits) - 1, pictures = clt_gray_pictures(gray), black = s->srgb ? 0 : full / 64;
  double exposure = 1 + s->drift * index / (pictures - 1);
  uint64_t random = s->seed * 1000003u + (uint64_t)index;
  bool rows = clt_gray_picture_at(gray, index).axis == 1;
  double *table = malloc(sizeof *table * SEEN_TABLE);
  assert_non_null(table);
  seen_fill(s, gray, index, table);
  for (int i = 0; i < SEEN_PIXELS; i++) {
    int u = i % SEEN_WIDTH, v = i / SEEN_WIDTH;
    double direct = seen_shadowed(s, u) ? 0 : seen_direct(s, rows, table, u, v, false);
    double more = s->mirror > 0 && v > SEEN_HEIGHT / 2 ? s->mirror * seen_direct(s, rows, table, u, v, true) : 0;
    double light = exposure * s->light * seen_albedo(u, v) * (direct + more + 0.5 * s->indirect);
    for (int c = 0; c < s->channels; c++) {
      double e = light * tint[c];
      if (s->electrons > 0) {
        e += sqrt(e / s->electrons + pow(8 / s->electrons, 2)) * seen_normal(&random);
      }
      e = s->srgb ? seen_encode_srgb(fmax(e, 0)) : e;
      samples[i * s->channels + c] = (uint16_t)fmin(fmax(lrint(black + e * (full - black)), 0), full);
    }
  }
  free(table);
  return (clt_frame){SEEN_WIDTH, SEEN_HEIGHT, s->channels, s->bits, samples, index, 0.01, (uint32_t)index};
}

static inline clt_camera_info seen_sensor(const seen_scene *s) {
  return (clt_camera_info){.width = SEEN_WIDTH,
                           .height = SEEN_HEIGHT,
                           .channels = s->channels,
                           .bits = s->bits,
                           .frame_s = 0.02,
                           .exposure_min_s = 1e-4,
                           .exposure_max_s = 0.02,
                           .black_level = s->srgb ? 0 : ((1 << s->bits) - 1) / 64,
                           .responsivity = 1,
                           .full_well = 1e4};
}

/* All frames of a scene, taken in. */
static inline void seen_take(const seen_scene *s, clt_pairs *pairs) {
  clt_error error = {0};
  clt_gray gray;
  assert_ok(clt_gray_init(&gray, PANEL_WIDTH, PANEL_HEIGHT, &error), error);
  clt_camera_info sensor = seen_sensor(s);
  clt_curve response = {.kind = s->srgb ? CLT_CURVE_SRGB : CLT_CURVE_LINEAR};
  assert_ok(clt_pairs_init(pairs, &gray, &sensor, &response, &error), error);
  uint16_t *samples = malloc(sizeof *samples * SEEN_PIXELS * 3);
  assert_non_null(samples);
  for (int k = 0; k < clt_gray_pictures(&gray); k++) {
    clt_frame frame = seen_frame(s, &gray, k, samples);
    clt_pairs_add(pairs, k, &frame);
  }
  free(samples);
}

/* A flat wall, seen well. */
static inline seen_scene seen_wall(uint64_t seed) {
  return (seen_scene){.pitch = 0.7,
                      .turn = 0.05,
                      .tilt = 0.1,
                      .bend = 0.05,
                      .blur = 0.5,
                      .indirect = 0.3,
                      .light = 0.6,
                      .electrons = 10000,
                      .bits = 12,
                      .channels = 1,
                      .seed = seed};
}

#endif
