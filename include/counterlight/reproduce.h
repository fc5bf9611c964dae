/* The report's tables and figures that rest on simulation, computed again and set beside its own numbers. */
#ifndef COUNTERLIGHT_REPRODUCE_H
#define COUNTERLIGHT_REPRODUCE_H

#include <stdbool.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CLT_REPRODUCED_MAX = 64, CLT_REPRODUCED_TEXT_MAX = 240 };

/* One claim of the report and what became of it. */
typedef struct clt_reproduced {
  char name[32];                        /* "Table 1", "Fig. 8c, albedo .45" */
  char report[CLT_REPRODUCED_TEXT_MAX]; /* what the report says */
  char ours[CLT_REPRODUCED_TEXT_MAX];   /* what came out here */
  bool pass;                            /* ours is as the report says, or better */
} clt_reproduced;

typedef struct clt_reproduction {
  int count;
  clt_reproduced rows[CLT_REPRODUCED_MAX];
} clt_reproduction;

typedef struct clt_reproduce_options {
  const char *folder; /* that exists, where .csv, .png, .svg and reproduce.html go */
  const char *scenes; /* folder of the scenes that come with counterlight; Figs. 9, 12 and 13 are of them */
  int largest;        /* cells of the largest rung of Fig. 10's ladder: 80, 320, 1280, 5120 or 10240; 0: 10240, which
                         takes minutes and 5 GB */
  /* Told before each part begins, `done` of `parts` being done; false stops (CLT_CANCELLED). NULL: nobody is told. */
  bool (*progress)(void *context, const char *part, int done, int parts);
  void *context;
} clt_reproduce_options;

/* Computes everything and writes it. A part that fails ends the whole. */
CLT_PUBLIC clt_status clt_reproduce(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
