/* The camera's picture of the room shakes: at time t it stands amplitude sin(2 pi hz t) cells off, and an exposure sees
 * the mean over its time. Between cells the picture is interpolated, beyond its edge it goes on as at the edge. */
#include <stdio.h>
#include <string.h>

#include "sim/effects/sine.h"
#include "sim/state.h"

/* Cells to each side that a displacement of at most 2 cells reaches; steps of an integral over time. */
enum { REACH = 2, SIDE = 2 * REACH + 1, STEPS = 64 };

static void read(clt_section root, clt_scene_description *description) {
  clt_section section = clt_section_group(root, "vibration");
  clt_vibration_description *vibration = &description->effects.vibration;
  vibration->hz = clt_read_number(section, "hz", 10.0, 0.01, 1000.0);
  clt_read_numbers(section, "amplitude", vibration->amplitude, 2, 2, -REACH, REACH);
}

static bool called_for(const clt_scene *scene, char *why) {
  const clt_vibration_description *vibration = &scene->description.effects.vibration;
  bool on = vibration->amplitude[0] != 0.0 || vibration->amplitude[1] != 0.0;
  snprintf(why, CLT_EFFECT_WHY_MAX,
           on ? "the picture shakes by %.4g x %.4g cells at %.4g Hz" : "projector and camera stand still",
           vibration->amplitude[0], vibration->amplitude[1], vibration->hz);
  return on;
}

static clt_status prepare(clt_scene *scene, clt_stage *stage, clt_error *error) {
  (void)error;
  stage->state = &scene->description.effects.vibration;
  return CLT_OK;
}

/* Adds `weight` of the displacement during `cycles` of the oscillation from a phase (in cycles) on. */
static void add_course(const clt_vibration_description *vibration, double phase, double cycles, double weight,
                       double kernel[SIDE][SIDE]) {
  for (int step = 0; step < STEPS; step++) {
    double swing = sin(2.0 * M_PI * (phase + cycles * (step + 0.5) / STEPS));
    for (int j = 0; j < SIDE; j++) {
      double down = fmax(0.0, 1.0 - fabs(j - REACH + swing * vibration->amplitude[1]));
      for (int i = 0; i < SIDE; i++) {
        kernel[j][i] += weight / STEPS * down * fmax(0.0, 1.0 - fabs(i - REACH + swing * vibration->amplitude[0]));
      }
    }
  }
}

/* kernel[j][i]: share of the light from the cell j - REACH further down and i - REACH further right. */
static void find_kernel(const clt_vibration_description *vibration, const clt_band *band, double kernel[SIDE][SIDE]) {
  double phase = 1e-9 * (double)band->start_ns * vibration->hz;
  double cycles = 1e-9 * (double)(band->end_ns - band->start_ns) * vibration->hz, whole = floor(cycles);
  memset(kernel, 0, sizeof(double[SIDE][SIDE]));
  if (whole > 0.0) {
    add_course(vibration, 0.0, 1.0, whole / cycles, kernel);
  }
  add_course(vibration, phase, cycles - whole, (cycles - whole) / cycles, kernel);
}

/* Row in the exposure that stands `cells` cells below row y, or the last one there. */
static int row_at(const clt_exposure *exposure, int y, int cells) {
  int cell = y / exposure->split + cells, most = exposure->height / exposure->split - 1;
  int within = cell < 0 ? 0 : cell > most ? most : cell;
  return within * exposure->split + y % exposure->split;
}

/* to += weight * from, `right` cells further right. */
static void add_row(float *to, const float *from, int width, int right, float weight) {
  int first = right < 0 ? -right : 0, last = right > 0 ? width - right : width;
  for (int x = 0; x < first && x < width; x++) {
    to[x] += weight * from[0];
  }
  for (int x = first; x < last; x++) {
    to[x] += weight * from[x + right];
  }
  for (int x = last > 0 ? last : 0; x < width; x++) {
    to[x] += weight * from[width - 1];
  }
}

static void expose(const void *state, clt_exposure *exposure, const clt_band *band) {
  double kernel[SIDE][SIDE];
  size_t width = (size_t)exposure->width, rows = (size_t)exposure->height;
  if (band->first == 0) {
    memcpy(exposure->scratch, exposure->radiance, (size_t)exposure->channels * rows * width * sizeof(float));
  }
  find_kernel(state, band, kernel);
  for (int c = 0; c < exposure->channels; c++) {
    for (int y = band->first; y < band->last; y++) {
      float *row = clt_exposure_row(exposure, c, y);
      memset(row, 0, width * sizeof *row);
      for (int k = 0; k < SIDE * SIDE; k++) {
        size_t from = (size_t)c * rows + (size_t)row_at(exposure, y, k / SIDE - REACH);
        if (kernel[k / SIDE][k % SIDE] != 0.0) {
          add_row(row, &exposure->scratch[from * width], exposure->width, k % SIDE - REACH,
                  (float)kernel[k / SIDE][k % SIDE]);
        }
      }
    }
  }
}

const clt_effect clt_effect_vibration = {
    .name = "vibration", .read = read, .called_for = called_for, .prepare = prepare, .expose = expose};
