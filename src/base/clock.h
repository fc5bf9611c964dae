/* Time. */
#ifndef CLT_BASE_CLOCK_H
#define CLT_BASE_CLOCK_H

#include <stdint.h>

/* Nanoseconds of CLOCK_MONOTONIC. */
int64_t clt_clock_ns(void);
/* Seconds since an earlier clt_clock_ns. */
double clt_clock_since(int64_t start_ns);

#endif
