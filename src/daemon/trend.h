/* The trend of verifications: what drifts, and how fast. */
#ifndef CLT_DAEMON_TREND_H
#define CLT_DAEMON_TREND_H

#include <stdbool.h>
#include <stddef.h>

enum { TREND_MOST = 32, TREND_LEAST = 4 };

/* The last TREND_MOST verifications, oldest first. */
typedef struct trend {
  size_t count;
  double time_s[TREND_MOST];                        /* on a monotonic clock */
  double error[TREND_MOST], brightness[TREND_MOST]; /* of the picture; of the light, of what T predicts */
} trend;

typedef struct trend_slopes {
  double error, brightness;                     /* per hour, by least squares */
  double error_deviation, brightness_deviation; /* standard deviations of these, by the scatter about the line */
} trend_slopes;

/* Adds a verification; the oldest goes where there is no room. */
void trend_add(trend *kept, double time_s, double error, double brightness);
/* False while there are fewer than TREND_LEAST, or all at one time. */
bool trend_measure(const trend *kept, trend_slopes *slopes);

#endif
