#include "rig/photometry/exposures.h"

#include <math.h>
#include <stdio.h>

#define SATURATED_SHARE 1e-3
#define LONGEST_BASE_S 1.0
static const double white[CLT_FIELD_CHANNELS] = {1, 1, 1}, dark[CLT_FIELD_CHANNELS] = {0, 0, 0};

/* Whether the white panel, which is shown, saturates pixels at an exposure. */
static clt_status try_exposure(clt_field_bench *bench, int64_t ready_ns, double seconds, bool *saturates,
                               clt_error *error) {
  clt_field field;
  clt_status status = clt_field_take(bench, ready_ns, seconds, 1, NULL, NULL, &field, error);
  *saturates = false;
  for (int c = 0; c < bench->channels; c++) {
    *saturates = *saturates || field.saturated[c] > SATURATED_SHARE;
  }
  return status;
}

clt_status clt_exposure_base(clt_field_bench *bench, double *base_s, clt_findings *findings, clt_error *error) {
  static const int periods[] = {2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64};
  const clt_camera_info *sensor = &bench->shots->sensor;
  double period_s = bench->shots->panel.refresh_s;
  int64_t ready_ns = 0;
  bool saturates = false;
  clt_status status = clt_field_show(bench, white, &ready_ns, error);
  *base_s = fmin(fmax(period_s, sensor->exposure_min_s), sensor->exposure_max_s);
  status = status == CLT_OK ? try_exposure(bench, ready_ns, *base_s, &saturates, error) : status;
  if (status == CLT_OK && saturates) {
    while (status == CLT_OK && saturates && *base_s > sensor->exposure_min_s) {
      *base_s = fmax(0.5 * *base_s, sensor->exposure_min_s);
      status = try_exposure(bench, ready_ns, *base_s, &saturates, error);
    }
    clt_findings_add(findings, saturates,
                     "a whole refresh period of %.4g ms saturates the camera under a white picture; close the aperture "
                     "or use a grey filter (measured with %.3g ms)",
                     period_s * 1e3, *base_s * 1e3);
    return status;
  }
  for (size_t k = 0; k < sizeof periods / sizeof periods[0] && status == CLT_OK; k++) {
    double longer = periods[k] * period_s;
    if (longer > fmin(sensor->exposure_max_s, LONGEST_BASE_S)) {
      break;
    }
    status = try_exposure(bench, ready_ns, longer, &saturates, error);
    if (saturates) {
      break;
    }
    *base_s = longer;
  }
  return status;
}

typedef struct series {
  double at_s[CLT_FLICKER_FRAMES], light[CLT_FLICKER_FRAMES];
} series;

/* Least squares of mean + a cos + b sin; the amplitude, and what is left of the variance. */
static double fit_sine(const series *seen, double mean, double hz, double *left) {
  double cc = 0, ss = 0, cs = 0, c0 = 0, s0 = 0, yc = 0, ys = 0, yy = 0;
  for (int n = 0; n < CLT_FLICKER_FRAMES; n++) {
    double c = cos(2 * M_PI * hz * seen->at_s[n]), s = sin(2 * M_PI * hz * seen->at_s[n]);
    c0 += c / CLT_FLICKER_FRAMES;
    s0 += s / CLT_FLICKER_FRAMES;
  }
  for (int n = 0; n < CLT_FLICKER_FRAMES; n++) {
    double c = cos(2 * M_PI * hz * seen->at_s[n]) - c0, s = sin(2 * M_PI * hz * seen->at_s[n]) - s0;
    double y = seen->light[n] - mean;
    cc += c * c;
    ss += s * s;
    cs += c * s;
    yc += y * c;
    ys += y * s;
    yy += y * y;
  }
  double determinant = cc * ss - cs * cs, a = 0, b = 0;
  if (determinant > 1e-3) { /* else the frames stand still against the mains */
    a = (ss * yc - cs * ys) / determinant;
    b = (cc * ys - cs * yc) / determinant;
  }
  *left = yy - a * yc - b * ys;
  return hypot(a, b);
}

clt_status clt_flicker_measure(clt_field_bench *bench, double seconds, clt_flicker *out, clt_error *error) {
  static const double candidates[] = {100, 120};
  series seen;
  int64_t ready_ns = 0;
  double mean = 0, best = INFINITY;
  *out = (clt_flicker){0};
  clt_status status = clt_field_show(bench, dark, &ready_ns, error);
  for (int n = 0; n < CLT_FLICKER_FRAMES && status == CLT_OK; n++) {
    clt_field field;
    status = clt_field_take(bench, ready_ns, seconds, 1, NULL, NULL, &field, error);
    seen.at_s[n] = field.at_s;
    seen.light[n] = (field.light[0] + field.light[1] + field.light[2]) / bench->channels;
    mean += seen.light[n] / CLT_FLICKER_FRAMES;
    ready_ns = (int64_t)(field.at_s * 1e9);
  }
  for (int k = 0; k < 2 && status == CLT_OK; k++) {
    double left = 0, amplitude = fit_sine(&seen, mean, candidates[k], &left);
    double spread = sqrt(left / (CLT_FLICKER_FRAMES - 3)), error_of_it = spread * sqrt(2.0 / CLT_FLICKER_FRAMES);
    double phase = M_PI * candidates[k] * seconds, kept = fabs(sin(phase) / phase);
    if (amplitude > 5 * error_of_it && amplitude > 0.01 * fabs(mean) * kept && left < best) {
      best = left;
      *out = (clt_flicker){candidates[k], amplitude / fmax(fabs(mean) * kept, 1e-30)};
    }
  }
  return status;
}

/* Signal to noise of rate e by t seconds. */
static double snr_at(const clt_exposure_needs *needs, double e, double t) {
  double electrons = e * t * needs->full_well;
  return electrons / sqrt(electrons + needs->read_noise * needs->read_noise);
}

/* Seconds rounded to whole periods: of refresh and flicker where those are not long against them, else of refresh. */
static double whole_periods(const clt_exposure_needs *needs, double seconds, bool up, bool *flicker_too) {
  double refresh = needs->refresh_s, both = 0;
  for (int n = 1; n <= 60 && needs->flicker_hz > 0 && both == 0; n++) {
    double cycles = n * refresh * needs->flicker_hz;
    both = fabs(cycles - rint(cycles)) < 0.02 ? n * refresh : 0;
  }
  *flicker_too = both > 0 && seconds >= both * (1 - 1e-9);
  double period = *flicker_too ? both : refresh;
  double periods = seconds / period;
  return periods < 1 - 1e-9 ? seconds : (up ? ceil(periods - 1e-6) : floor(periods + 1e-6)) * period;
}

static void add_exposure(const clt_exposure_needs *needs, double seconds, bool up, clt_exposure_choice *choice) {
  bool flicker_too;
  double rounded = fmin(fmax(whole_periods(needs, seconds, up, &flicker_too), needs->least_s), needs->most_s);
  if (choice->count > 0 && rounded <= choice->seconds[choice->count - 1] * (1 + 1e-9)) {
    return;
  }
  snprintf(choice->reason[choice->count], sizeof choice->reason[0],
           "%.4g refresh periods%s: white fills %.3g of the well, black has %.3g to 1", rounded / needs->refresh_s,
           flicker_too ? " and whole ones of the flicker" : "", needs->brightest * rounded,
           snr_at(needs, needs->darkest, rounded));
  choice->seconds[choice->count++] = rounded;
}

void clt_exposures_choose(const clt_exposure_needs *needs, clt_exposure_choice *choice) {
  const double filled = 0.8, between_snr = 30, ratio_least = 2, ratio_most = 8;
  bool flicker_too;
  double shortest = whole_periods(needs, filled / needs->brightest, false, &flicker_too);
  double r = needs->read_noise, s = needs->snr;
  /* n / sqrt(n + r^2) = s solved for the electrons n. */
  double electrons = 0.5 * (s * s + sqrt(s * s * s * s + 4 * s * s * r * r));
  double longest = fmin(fmax(electrons / (needs->full_well * needs->darkest), shortest), needs->most_s);
  double between =
      0.5 * (between_snr * between_snr + sqrt(pow(between_snr, 4) + 4 * between_snr * between_snr * r * r));
  *choice = (clt_exposure_choice){.ratio = fmin(fmax(needs->full_well / between, ratio_least), ratio_most)};
  int steps = (int)ceil(log(longest / shortest) / log(choice->ratio) - 1e-9);
  steps = steps < 0 ? 0 : steps > CLT_EXPOSURES_MAX - 1 ? CLT_EXPOSURES_MAX - 1 : steps;
  for (int k = 0; k <= steps; k++) {
    double seconds = steps > 0 ? shortest * pow(longest / shortest, (double)k / steps) : shortest;
    add_exposure(needs, seconds, k > 0, choice);
  }
  choice->snr = snr_at(needs, needs->darkest, choice->seconds[choice->count - 1]);
}
