/* The log of the daemon: lines on stderr, which the journal takes with their level. */
#ifndef CLT_BASE_LOG_H
#define CLT_BASE_LOG_H

#include "counterlight/status.h"

/* syslog's numbers, which the journal reads as a "<N>" prefix. */
typedef enum clt_log_level {
  CLT_LOG_ERROR = 3,
  CLT_LOG_WARNING = 4,
  CLT_LOG_NOTICE = 5,
  CLT_LOG_INFO = 6
} clt_log_level;

/* Writes one line at once (whole even when several threads log). */
void clt_log(clt_log_level level, const char *format, ...) CLT_PRINTF(2, 3);

#endif
