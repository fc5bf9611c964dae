#include "rig/photometry/field.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"

/* Sample, as a fraction of full scale, from which a pixel counts as saturated. */
#define SATURATED 0.97
/* A pixel is well lit from this share of the 90th percentile on. */
#define WELL_LIT 0.25
/* That percentile is at least this, of full scale, and so many times the noise. */
#define LEAST_GAIN 1e-4f
#define LEAST_OVER_NOISE 4

clt_status clt_field_bench_init(clt_field_bench *bench, clt_shots *shots, clt_error *error) {
  const clt_camera_info *sensor = &shots->sensor;
  const clt_projector_info *panel = &shots->panel;
  size_t pixels = (size_t)sensor->width * (size_t)sensor->height;
  *bench = (clt_field_bench){
      .shots = shots,
      .channels = sensor->channels,
      .pixels = pixels,
      .lit = pixels,
      .codes = clt_alloc((size_t)panel->width * (size_t)panel->height * (size_t)panel->channels, sizeof(float)),
      .group = clt_alloc(pixels, sizeof *bench->group),
      .light = clt_alloc((size_t)1 << sensor->bits, sizeof *bench->light)};
  if (bench->codes == NULL || bench->group == NULL || bench->light == NULL) {
    clt_field_bench_finish(bench);
    return clt_fail(error, CLT_FAILED, "out of memory for measuring the responses by %zu pixels", pixels);
  }
  if (clt_steady_init(&bench->steady, shots, error) != CLT_OK) {
    clt_field_bench_finish(bench);
    return CLT_FAILED;
  }
  for (size_t p = 0; p < pixels; p++) {
    bench->group[p] = 1;
  }
  clt_field_set_response(bench, sensor->black_level, &(clt_curve){.kind = CLT_CURVE_LINEAR});
  return CLT_OK;
}

void clt_field_bench_finish(clt_field_bench *bench) {
  free(bench->codes);
  free(bench->group);
  free(bench->light);
  clt_steady_finish(&bench->steady);
  *bench = (clt_field_bench){0};
}

void clt_field_set_response(clt_field_bench *bench, double black_level, const clt_curve *response) {
  int top = (1 << bench->shots->sensor.bits) - 1;
  bench->black_level = black_level;
  for (int code = 0; code <= top; code++) {
    double v = (code - black_level) / (top - black_level);
    bench->light[code] = (float)copysign(clt_curve_decode(response, fabs(v)), v);
  }
}

clt_status clt_field_show(clt_field_bench *bench, const double code[CLT_FIELD_CHANNELS], int64_t *ready_ns,
                          clt_error *error) {
  const clt_projector_info *panel = &bench->shots->panel;
  size_t plane = (size_t)panel->width * (size_t)panel->height;
  for (size_t k = 0; k < plane * (size_t)panel->channels; k++) {
    bench->codes[k] = (float)code[k / plane];
  }
  return clt_shots_show(bench->shots, bench->codes, ready_ns, error);
}

/* Adds one frame's sums over the lit pixels. */
static void add_frame(const clt_field_bench *bench, const clt_frame *frame, clt_field *field) {
  double full = (1 << frame->bits) - 1, limit = SATURATED * full;
  for (int c = 0; c < bench->channels; c++) {
    double sum = 0, saturated = 0, samples[CLT_FIELD_GROUPS + 1] = {0}, count[CLT_FIELD_GROUPS + 1] = {0};
    for (size_t p = 0; p < bench->pixels; p++) {
      uint16_t sample = frame->samples[p * (size_t)frame->channels + (size_t)c];
      uint8_t group = bench->group[p];
      if (group > 0) {
        sum += (double)bench->light[sample];
        saturated += sample >= limit;
        samples[group] += sample;
        count[group] += 1;
      }
    }
    field->light[c] += sum / (double)bench->lit;
    field->saturated[c] += saturated / (double)bench->lit;
    for (int g = 1; g <= CLT_FIELD_GROUPS; g++) {
      field->brightest = fmax(field->brightest, count[g] > 0 ? samples[g] / count[g] / full : 0);
    }
  }
}

/* The next frame: one that agrees with the others of its field where there are enough to compare. */
static clt_status next_frame(clt_field_bench *bench, bool compare, int64_t ready_ns, double seconds, clt_frame *frame,
                             clt_error *error) {
  return compare ? clt_steady_next(&bench->steady, frame, error)
                 : clt_shots_take(bench->shots, ready_ns, seconds, frame, error);
}

static clt_status report(clt_field_bench *bench, clt_error *error) {
  bench->done++;
  bench->expected = bench->done > bench->expected ? bench->done : bench->expected;
  return bench->progress == NULL || bench->progress(bench->context, bench->done, bench->expected)
             ? CLT_OK
             : clt_fail(error, CLT_CANCELLED, "photometry was stopped after %d fields", bench->done);
}

clt_status clt_field_take(clt_field_bench *bench, int64_t ready_ns, double seconds, int frames, clt_field_look *look,
                          void *context, clt_field *field, clt_error *error) {
  bool compare = frames >= CLT_STEADY_HELD;
  clt_status status = compare ? clt_steady_begin(&bench->steady, ready_ns, seconds, error) : CLT_OK;
  *field = (clt_field){.seconds = 0};
  for (int n = 0; n < frames && status == CLT_OK; n++) {
    clt_frame frame;
    status = next_frame(bench, compare, ready_ns, seconds, &frame, error);
    if (status != CLT_OK) {
      break;
    }
    add_frame(bench, &frame, field);
    if (look != NULL) {
      look(context, bench, &frame);
    }
    field->seconds += frame.exposure_s / frames;
    field->at_s += ((double)frame.exposed_ns * 1e-9 + 0.5 * frame.exposure_s) / frames;
    ready_ns = frame.exposed_ns + 1;
  }
  for (int c = 0; c < bench->channels; c++) {
    field->light[c] /= frames;
    field->saturated[c] /= frames;
  }
  return status == CLT_OK ? report(bench, error) : status;
}

clt_status clt_field_see(clt_field_bench *bench, const double code[CLT_FIELD_CHANNELS], double seconds, int frames,
                         clt_field *field, clt_error *error) {
  int64_t ready_ns = 0;
  clt_status status = clt_field_show(bench, code, &ready_ns, error);
  return status == CLT_OK ? clt_field_take(bench, ready_ns, seconds, frames, NULL, NULL, field, error) : status;
}

/* Adds (or, with a negative weight, takes off) what a frame shows, summed over the channels of each pixel. */
typedef struct difference {
  float weight, *sum;
} difference;

static void add_difference(void *context, const clt_field_bench *bench, const clt_frame *frame) {
  difference *self = context;
  for (size_t p = 0; p < bench->pixels; p++) {
    float light = 0;
    for (int c = 0; c < frame->channels; c++) {
      light += bench->light[frame->samples[p * (size_t)frame->channels + (size_t)c]];
    }
    self->sum[p] += self->weight * light;
  }
}

/* Groups by value; sorted is work space. */
static clt_status sort_into_groups(clt_field_bench *bench, const float *gain, float *sorted, clt_error *error) {
  size_t pixels = bench->pixels, lit = 0;
  for (size_t p = 0; p < pixels; p++) {
    sorted[p] = gain[p];
  }
  clt_sort_floats(sorted, pixels);
  float bright = sorted[pixels * 9 / 10], noise = fmaxf(-sorted[pixels / 10], 0), least = WELL_LIT * bright;
  /* Of noise alone as much is below nothing as above. */
  if (!(bright > LEAST_GAIN && bright > LEAST_OVER_NOISE * noise)) {
    return clt_fail(
        error, CLT_FAILED,
        "the white panel is hardly brighter to the camera than the dark one (by %.2g of full scale); is the "
        "projector on, its shutter open, and the camera looking at its picture?",
        (double)bright);
  }
  size_t first = 0;
  while (sorted[first] < least) {
    first++;
  }
  lit = pixels - first;
  for (size_t p = 0; p < pixels; p++) {
    int group = 0;
    while (gain[p] >= least && group < CLT_FIELD_GROUPS &&
           gain[p] >= sorted[first + lit * (size_t)group / CLT_FIELD_GROUPS]) {
      group++;
    }
    bench->group[p] = (uint8_t)group;
  }
  bench->lit = lit;
  return CLT_OK;
}

clt_status clt_field_find_groups(clt_field_bench *bench, double seconds, int frames, clt_error *error) {
  static const double white[CLT_FIELD_CHANNELS] = {1, 1, 1}, dark[CLT_FIELD_CHANNELS] = {0, 0, 0};
  float *gain = clt_alloc(2 * bench->pixels, sizeof *gain);
  int64_t ready_ns = 0;
  clt_field field;
  if (gain == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for finding the lit ones of %zu pixels", bench->pixels);
  }
  difference sum = {1.0f / (float)frames, gain};
  clt_status status = clt_field_show(bench, white, &ready_ns, error);
  if (status == CLT_OK) {
    status = clt_field_take(bench, ready_ns, seconds, frames, add_difference, &sum, &field, error);
  }
  sum.weight = -sum.weight;
  status = status == CLT_OK ? clt_field_show(bench, dark, &ready_ns, error) : status;
  if (status == CLT_OK) {
    status = clt_field_take(bench, ready_ns, seconds, frames, add_difference, &sum, &field, error);
  }
  if (status == CLT_OK) {
    status = sort_into_groups(bench, gain, gain + bench->pixels, error);
  }
  free(gain);
  return status;
}
