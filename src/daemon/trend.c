#include "daemon/trend.h"

#include <math.h>
#include <string.h>

static const double HOUR_S = 3600;

static void push(double *values, size_t count, double value) {
  if (count == TREND_MOST) {
    memmove(values, values + 1, (TREND_MOST - 1) * sizeof *values);
    count--;
  }
  values[count] = value;
}

void trend_add(trend *kept, double time_s, double error, double brightness) {
  push(kept->time_s, kept->count, time_s);
  push(kept->error, kept->count, error);
  push(kept->brightness, kept->count, brightness);
  kept->count += kept->count < TREND_MOST;
}

static double mean(const double *values, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; i++) {
    sum += values[i];
  }
  return sum / (double)count;
}

/* The slope of values over time and its standard deviation, sqrt(sum of residual^2 / (n - 2) / sum (t - mean)^2), both
 * per hour. False where no time passed. */
static bool fit_line(const trend *kept, const double *values, double *slope, double *deviation) {
  double about = mean(kept->time_s, kept->count), level = mean(values, kept->count), spread = 0, together = 0, rest = 0;
  for (size_t i = 0; i < kept->count; i++) {
    double t = kept->time_s[i] - about;
    spread += t * t;
    together += t * (values[i] - level);
  }
  if (!(spread > 0)) {
    return false;
  }
  for (size_t i = 0; i < kept->count; i++) {
    double off = values[i] - level - together / spread * (kept->time_s[i] - about);
    rest += off * off;
  }
  *slope = HOUR_S * together / spread;
  *deviation = HOUR_S * sqrt(rest / (double)(kept->count - 2) / spread);
  return true;
}

bool trend_measure(const trend *kept, trend_slopes *slopes) {
  return kept->count >= TREND_LEAST && fit_line(kept, kept->error, &slopes->error, &slopes->error_deviation) &&
         fit_line(kept, kept->brightness, &slopes->brightness, &slopes->brightness_deviation);
}
