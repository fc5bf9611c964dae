/* What calibration found that a person should know: one line each, with how much and what to do. */
#ifndef CLT_RIG_FINDING_H
#define CLT_RIG_FINDING_H

#include <stdbool.h>

#include "counterlight/status.h"

enum { CLT_FINDING_TEXT = 200, CLT_FINDINGS_MAX = 32 };

typedef struct clt_finding {
  bool serious; /* what is measured with it stays wrong until it is put right */
  char text[CLT_FINDING_TEXT];
} clt_finding;

/* A zeroed one is empty. */
typedef struct clt_findings {
  int count;
  clt_finding item[CLT_FINDINGS_MAX];
} clt_findings;

/* Adds a line; a list that is full keeps what it has. */
void clt_findings_add(clt_findings *findings, bool serious, const char *format, ...) CLT_PRINTF(3, 4);

#endif
