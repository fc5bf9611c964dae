/* How far a scene's light is from the exact one, at sampled cells. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/light.h"
#include "sim/radiosity.h"
#include "sim/state.h"

/* Sampled cells, and what they show: values of cell k of channel c at [c * count + k]. */
typedef struct sample {
  int count, *cell;
  double *drive;             /* of every cell: channels * cells values */
  double *simulated, *exact; /* radiance without the black */
} sample;

static clt_status out_of_memory(const clt_scene *scene, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s: out of memory for a reference", scene->description.path);
}

/* The drive as it reaches the surfaces. */
static clt_status take_drive(const clt_scene *scene, const clt_image *drive, sample *of, clt_error *error) {
  size_t values = scene->plan.values;
  float *shown = clt_alloc(3 * values, sizeof *shown);
  if (shown == NULL) {
    return out_of_memory(scene, error);
  }
  memcpy(shown, drive->data, values * sizeof *shown);
  clt_plan_drive(&scene->plan, shown, shown + values);
  for (size_t k = 0; k < values; k++) {
    of->drive[k] = (double)shown[k];
  }
  free(shown);
  return CLT_OK;
}

/* Spread evenly over the grid (Weyl's sequence), each cell at most once. */
static void choose_cells(int cells, int wanted, sample *of) {
  const double golden = 0.6180339887498949;
  int stride = (int)fmax(1.0, floor(golden * cells));
  while (stride > 1 && cells % stride == 0) {
    stride--;
  }
  of->count = wanted < cells ? wanted : cells;
  for (int k = 0, at = cells / 3; k < of->count; k++) {
    of->cell[k] = at;
    at = (int)(((long long)at + stride) % cells);
  }
}

/* A small scene: rows of T in double, from a factor of its light equation made anew. */
static clt_status take_rows(const clt_scene *scene, sample *of, clt_error *error) {
  const clt_scene_description *description = &scene->description;
  clt_light light = {.solved = -1};
  clt_status status = clt_light_init(&light, description, error);
  size_t cells = scene->plan.values / (size_t)description->channels;
  double *row = clt_alloc(2 * cells + (size_t)light.layout.mesh.used, sizeof *row), *seen = row + cells;
  if (status == CLT_OK && row == NULL) {
    status = out_of_memory(scene, error);
  }
  for (int c = 0; c < description->channels && status == CLT_OK; c++) {
    const double *x = &of->drive[(size_t)c * cells];
    status = clt_light_solve(&light, c, error);
    clt_transport_apply(scene->transport, c, x, seen);
    for (int k = 0; k < of->count && status == CLT_OK; k++) {
      size_t at = (size_t)c * (size_t)of->count + (size_t)k;
      clt_light_row(&light, c, of->cell[k], row, seen + cells);
      of->simulated[at] = seen[of->cell[k]];
      of->exact[at] = 0.0;
      for (size_t j = 0; j < cells; j++) {
        of->exact[at] += (1.0 - description->projector.black) * row[j] * x[j];
      }
    }
  }
  free(row);
  clt_light_finish(&light);
  return status;
}

static double most_albedo(const clt_scene_description *description, int channel) {
  double most = 0.0;
  for (int k = 0; k < description->surface_count; k++) {
    most = fmax(most, description->surfaces[k].albedo[channel]);
  }
  return most;
}

/* The errors, relative to the rms of the exact radiance. Light that is off by r in its equation is off by at most
 * r / (1 - m) itself, m the greatest albedo (||A|| <= m). */
static clt_reference compare(const clt_scene *scene, const sample *of, bool gathered) {
  clt_reference found = {.cells = of->count};
  double errors = 0.0, squares = 0.0, bound = 0.0, most = 0.0;
  for (int c = 0; c < scene->description.channels; c++) {
    double amplified = gathered ? 1.0 / (1.0 - most_albedo(&scene->description, c)) : 1.0;
    for (int k = c * of->count; k < (c + 1) * of->count; k++) {
      double error = of->simulated[k] - of->exact[k];
      errors += error * error;
      squares += of->exact[k] * of->exact[k];
      most = fmax(most, fabs(error));
      bound += error * error * amplified * amplified;
    }
  }
  double scale = sqrt(squares), values = (double)of->count * scene->description.channels;
  found.rms = scale > 0.0 ? sqrt(errors) / scale : 0.0;
  found.largest = scale > 0.0 ? most * sqrt(values) / scale : 0.0;
  found.bound = scale > 0.0 ? sqrt(bound) / scale : 0.0;
  return found;
}

clt_status clt_scene_reference(const clt_scene *scene, const clt_image *drive, int cells, clt_reference *out,
                               clt_error *error) {
  const clt_scene_description *description = &scene->description;
  size_t channels = (size_t)description->channels;
  if (description->surface_count == 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: the light of a transport file is what the file says; there is no "
                    "geometry to compare with",
                    description->path);
  }
  if (drive->width != description->width || drive->height != description->height ||
      drive->channels != description->channels || cells < 1) {
    return clt_fail(error, CLT_BAD_INPUT, "the drive must have the scene's grid, and a reference at least one cell");
  }
  sample of = {.count = 0};
  of.cell = clt_alloc((size_t)cells, sizeof *of.cell);
  of.drive = clt_alloc(scene->plan.values, sizeof *of.drive);
  of.simulated = clt_alloc(2 * channels * (size_t)cells, sizeof *of.simulated);
  clt_status status = CLT_OK;
  if (of.cell == NULL || of.drive == NULL || of.simulated == NULL) {
    status = out_of_memory(scene, error);
  }
  if (status == CLT_OK) {
    of.exact = of.simulated + channels * (size_t)cells;
    choose_cells(description->width * description->height, cells, &of);
    status = take_drive(scene, drive, &of, error);
  }
  bool gathered = clt_radiosity_is(scene->transport);
  if (status == CLT_OK) {
    status = gathered
                 ? clt_radiosity_gather(scene->transport, of.drive, of.cell, of.count, of.simulated, of.exact, error)
                 : take_rows(scene, &of, error);
  }
  if (status == CLT_OK) {
    *out = compare(scene, &of, gathered);
  }
  free(of.cell);
  free(of.drive);
  free(of.simulated);
  return status;
}
