/* A rig that multiplies: y = b0 + T x by a given dense matrix, with the noise of a camera where wanted. */
#ifndef CLT_TESTS_ACQUIRE_FAKE_RIG_H
#define CLT_TESTS_ACQUIRE_FAKE_RIG_H

#include <signal.h>

#include "counterlight/rig.h"
#include "noise.h"

typedef struct fake_rig {
  clt_rig base;
  int width, height, channels;
  const double *transport; /* [c][i][j], c modulo matrices */
  int matrices;            /* channels share matrices where there are fewer */
  double black;
  double dark;   /* deviation of an observation without light */
  double photon; /* its variance grows by this times the radiance */
  size_t blind;  /* this cell is never seen; SIZE_MAX: none */
  uint64_t random;
  long patterns;
  double pattern_s; /* of the devices' time */
  long doubted;     /* patterns at which exposures contradicted each other */
  double lamp_gain; /* of the light, black aside, in pattern n: 1 + lamp_gain sin(n / 20) */
  long shaded_at;   /* in that pattern the cells of the left third have `shade` of their light; 0: never */
  double shade;
  double bend;           /* the camera gives light^(1 + bend) */
  unsigned pause_us;     /* that an observation takes */
  long dies_at;          /* kill -9 of the process before that pattern; 0: never */
  clt_status fails_with; /* from pattern fails_at on */
  long fails_at;
  bool moving; /* it fails because exposures contradict each other */
} fake_rig;

static inline void fake_describe(const clt_rig *base, clt_rig_info *info) {
  const fake_rig *rig = (const fake_rig *)base;
  *info = (clt_rig_info){.width = rig->width,
                         .height = rig->height,
                         .channels = rig->channels,
                         .response = "gamma 2.2",
                         .source = "a matrix",
                         .patterns = rig->patterns,
                         .frames = 3 * rig->patterns,
                         .doubted = rig->doubted,
                         .seconds = rig->pattern_s * (double)rig->patterns};
}

/* The light of one cell; patterns are mostly zeros, which lit lists the rest of. */
static inline double fake_light(const fake_rig *rig, int channel, size_t i, const float *drive, const size_t *lit,
                                size_t count) {
  size_t cells = (size_t)rig->width * (size_t)rig->height;
  const double *row = rig->transport + ((size_t)(channel % rig->matrices) * cells + i) * cells;
  double light = rig->black;
  for (size_t k = 0; k < count; k++) {
    light += row[lit[k]] * drive[lit[k]];
  }
  return light;
}

static inline clt_status fake_observe(clt_rig *base, const clt_image *drive, clt_image *radiance, clt_image *deviation,
                                      clt_error *error) {
  fake_rig *rig = (fake_rig *)base;
  size_t cells = (size_t)rig->width * (size_t)rig->height, *lit = calloc(cells, sizeof *lit);
  if (rig->dies_at > 0 && rig->patterns + 1 >= rig->dies_at) {
    kill(getpid(), SIGKILL);
  }
  if (rig->pause_us > 0) {
    usleep(rig->pause_us);
  }
  if (++rig->patterns >= rig->fails_at && rig->fails_with != CLT_OK) {
    free(lit);
    rig->doubted += rig->moving;
    return clt_fail(error, rig->fails_with, "the fake is told to fail");
  }
  for (int c = 0; c < rig->channels; c++) {
    const float *x = drive->data + (size_t)c * cells;
    size_t count = 0;
    for (size_t j = 0; j < cells; j++) {
      assert_true(x[j] >= 0 && x[j] <= 1);
      if (x[j] != 0) {
        lit[count++] = j;
      }
    }
    for (size_t i = 0; i < cells; i++) {
      double light = fake_light(rig, c, i, x, lit, count);
      light = rig->black + (light - rig->black) * (1 + rig->lamp_gain * sin((double)rig->patterns / 20));
      light *= rig->patterns == rig->shaded_at && i % (size_t)rig->width < (size_t)rig->width / 3 ? rig->shade : 1;
      light = rig->bend != 0 ? pow(light, 1 + rig->bend) : light;
      double sigma = sqrt(rig->dark * rig->dark + rig->photon * light);
      radiance->data[(size_t)c * cells + i] = (float)(light + sigma * (sigma > 0 ? test_normal(&rig->random) : 0));
      deviation->data[(size_t)c * cells + i] = i == rig->blind ? INFINITY : (float)sigma;
    }
  }
  free(lit);
  return CLT_OK;
}

static inline fake_rig fake_rig_make(int width, int height, int channels, const double *transport, int matrices) {
  static const clt_rig_operations operations = {fake_describe, fake_observe, NULL};
  return (fake_rig){.base = {&operations},
                    .width = width,
                    .height = height,
                    .channels = channels,
                    .transport = transport,
                    .matrices = matrices,
                    .black = 0.01,
                    .blind = SIZE_MAX,
                    .random = 1};
}

#endif
