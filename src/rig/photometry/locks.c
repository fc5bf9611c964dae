#include "rig/photometry/locks.h"

#include <math.h>

#define BEFORE_S 2.0 /* that another picture is shown before */
#define STEP_S 0.2   /* from sample to sample */
#define FIELD_S 0.1  /* that the frames of a sample take */
/* Movements that a locked camera does not show. */
#define GAIN_MOVES 0.01
#define DRIFT_MOVES 0.015
#define COLOUR_MOVES 0.015
#define SHARPNESS_MOVES 0.06
/* The signal of a doubled exposure grows at least by this much even behind a response of gamma 3 (1.26). */
#define OBEYS 1.15
enum { SAMPLES_MAX = 240, SMOOTHED = 3, SQUARES = 8 };

typedef struct watch {
  int count;
  double brightness[SAMPLES_MAX], colour[SAMPLES_MAX], sharpness[SAMPLES_MAX];
} watch;

/* SQUARES x SQUARES squares, bright and dark in turn. */
static clt_status show_squares(clt_field_bench *bench, int64_t *ready_ns, clt_error *error) {
  const clt_projector_info *panel = &bench->shots->panel;
  for (int n = 0; n < panel->width * panel->height * panel->channels; n++) {
    int x = n % panel->width, y = n / panel->width % panel->height;
    int square = x * SQUARES / panel->width + y * SQUARES / panel->height;
    bench->codes[n] = square % 2 == 0 ? 1.0f : 0.0f;
  }
  return clt_shots_show(bench->shots, bench->codes, ready_ns, error);
}

/* Mean squared step from a pixel to its right neighbour over the mean square: falls where the picture blurs. */
static void measure_sharpness(void *context, const clt_field_bench *bench, const clt_frame *frame) {
  double *sharpness = context, steps = 0, squares = 0;
  size_t stride = (size_t)frame->channels;
  int green = frame->channels > 1 ? 1 : 0;
  for (int y = 0; y < frame->height; y++) {
    const uint16_t *row = frame->samples + (size_t)y * (size_t)frame->width * stride + (size_t)green;
    for (int x = 0; x + 1 < frame->width; x++) {
      double here = (double)bench->light[row[(size_t)x * stride]],
             next = (double)bench->light[row[((size_t)x + 1) * stride]];
      steps += (next - here) * (next - here);
      squares += here * here;
    }
  }
  *sharpness += steps / fmax(squares, 1e-30);
}

/* Looks at what is shown for some seconds. */
static clt_status look(clt_field_bench *bench, int64_t ready_ns, double seconds, double base_s, watch *seen,
                       clt_error *error) {
  double start_s = (double)ready_ns * 1e-9, at_s = start_s;
  clt_status status = CLT_OK;
  seen->count = 0;
  while (status == CLT_OK && at_s < start_s + seconds && seen->count < SAMPLES_MAX) {
    clt_field field;
    double sharpness = 0;
    status = clt_field_take(bench, ready_ns, base_s, SMOOTHED, measure_sharpness, &sharpness, &field, error);
    int n = seen->count++;
    at_s = field.at_s;
    seen->brightness[n] = field.light[0] + field.light[1] + field.light[2];
    seen->colour[n] = bench->channels > 1 ? field.light[0] / fmax(field.light[2], 1e-9) : 1;
    seen->sharpness[n] = sharpness / SMOOTHED;
    ready_ns = (int64_t)((at_s + fmin(STEP_S, 0.5 * bench->shots->timeout_s)) * 1e9);
  }
  return status;
}

/* Largest over smallest of the values from first on, less 1. */
static double movement(const double *values, int first, int count) {
  double least = INFINITY, most = 0;
  for (int n = first; n < count; n++) {
    least = fmin(least, values[n]);
    most = fmax(most, values[n]);
  }
  return most / fmax(least, 1e-12) - 1;
}

/* What a watch begins with over what it ends with, less 1. */
static double settling(const watch *seen) {
  int last = seen->count - 1;
  double end = last >= 2 ? (seen->brightness[last] + seen->brightness[last - 1]) / 2 : seen->brightness[last];
  return seen->brightness[0] / fmax(end, 1e-12) - 1;
}

/* Growth of the signal from an exposure to its double, from base_s downwards. */
static clt_status check_obedience(clt_field_bench *bench, int64_t ready_ns, double base_s, double *obedience,
                                  clt_error *error) {
  double longer = 0;
  *obedience = INFINITY;
  for (int k = 0; k < 3; k++) {
    double seconds = base_s / (1 << k);
    clt_field field;
    if (seconds < bench->shots->sensor.exposure_min_s) {
      break;
    }
    clt_status status = clt_field_take(bench, ready_ns, seconds, SMOOTHED, NULL, NULL, &field, error);
    if (status != CLT_OK) {
      return status;
    }
    double signal = field.light[0] + field.light[1] + field.light[2];
    *obedience = k > 0 ? fmin(*obedience, longer / fmax(signal, 1e-9)) : *obedience;
    longer = signal;
  }
  return CLT_OK;
}

static void judge(const clt_locks *locks, clt_findings *findings) {
  if (fabs(locks->gain) > GAIN_MOVES) {
    clt_findings_add(findings, true,
                     "the camera's gain or exposure is automatic: after a change of picture its brightness moved %.1f "
                     "%%; lock both: v4l2-ctl -c auto_exposure=1,gain_automatic=0",
                     100 * fabs(locks->gain));
  } else if (locks->drift > DRIFT_MOVES) {
    clt_findings_add(
        findings, false,
        "the brightness drifted by %.1f %% in %.0f s; let projector and camera warm up for 20 minutes, and "
        "lock the camera's gain",
        100 * locks->drift, locks->seconds);
  }
  if (locks->colour > COLOUR_MOVES) {
    clt_findings_add(findings, true,
                     "the camera's white balance is automatic: its red/blue ratio moved %.1f %% in %.0f s; lock it: "
                     "v4l2-ctl -c white_balance_automatic=0",
                     100 * locks->colour, locks->seconds);
  }
  if (locks->sharpness > SHARPNESS_MOVES) {
    clt_findings_add(findings, true,
                     "the camera's focus is automatic: its sharpness moved %.0f %% in %.0f s; lock it: v4l2-ctl -c "
                     "focus_automatic_continuous=0",
                     100 * locks->sharpness, locks->seconds);
  }
  if (locks->obedience < OBEYS) {
    clt_findings_add(findings, true,
                     "the camera does not obey its exposure time: twice the time gave %.2f times the signal; set its "
                     "exposure to manual: v4l2-ctl -c auto_exposure=1",
                     locks->obedience);
  }
}

static double watched(double watch_s) {
  return 1.25 * watch_s + 2 * BEFORE_S;
}

int clt_locks_fields(double watch_s) {
  return watch_s > 0 ? (int)(watched(watch_s) / (STEP_S + FIELD_S)) : 0;
}

clt_status clt_locks_check(clt_field_bench *bench, double base_s, double watch_s, clt_locks *out,
                           clt_findings *findings, clt_error *error) {
  static const double before[2][CLT_FIELD_CHANNELS] = {{0, 0, 0}, {1, 0, 0}};
  const double seconds[2] = {watch_s, 0.25 * watch_s};
  watch seen, ignored;
  double settles[2] = {0, 0};
  *out = (clt_locks){.seconds = watched(watch_s), .obedience = INFINITY};
  for (int k = 0; k < 2; k++) {
    int64_t ready_ns = 0;
    clt_status status = clt_field_show(bench, before[k], &ready_ns, error);
    status = status == CLT_OK ? look(bench, ready_ns, BEFORE_S, base_s, &ignored, error) : status;
    status = status == CLT_OK ? show_squares(bench, &ready_ns, error) : status;
    status = status == CLT_OK ? look(bench, ready_ns, seconds[k], base_s, &seen, error) : status;
    if (status == CLT_OK && k == 1) {
      status = check_obedience(bench, ready_ns, base_s, &out->obedience, error);
    }
    if (status != CLT_OK) {
      return status;
    }
    settles[k] = settling(&seen);
    out->drift = fmax(out->drift, movement(seen.brightness, 0, seen.count));
    out->colour = fmax(out->colour, movement(seen.colour, 0, seen.count));
    out->sharpness = fmax(out->sharpness, movement(seen.sharpness, 0, seen.count));
  }
  out->gain = fabs(settles[0]) > fabs(settles[1]) ? settles[0] : settles[1];
  judge(out, findings);
  return CLT_OK;
}
