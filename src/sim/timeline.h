/* Which pattern lights the room when. Times in ns of the scene's clock. */
#ifndef CLT_SIM_TIMELINE_H
#define CLT_SIM_TIMELINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"
#include "sim/effects/effect.h"

/* A pattern that lights the room from lit_ns until the next one does. */
typedef struct clt_lighting {
  struct clt_lighting *next;
  int64_t lit_ns;
  bool computed;           /* radiance holds its appearance */
  float *drive, *radiance; /* values, and layers * values entries */
} clt_lighting;

typedef struct clt_timeline {
  /* radiance of the cells under a drive of values entries */
  void (*light)(void *context, const float *drive, float *radiance);
  void *context;              /* outlives the timeline */
  size_t values;              /* channels * cells */
  int layers;                 /* the radiance under a drive has so many times as many values */
  clt_lighting *first, *last; /* by ascending time; never empty after init */
  clt_lighting *spare;        /* forgotten ones, to be used again */
} clt_timeline;

/* Its light, context, values and layers are set. Starts with a dark panel since ever. timeline was zeroed by the caller
 * and is finished by it in either case. */
clt_status clt_timeline_init(clt_timeline *timeline, clt_error *error);
void clt_timeline_finish(clt_timeline *timeline);

/* From lit_ns on (not before any earlier one) the room is lit by drive, which is copied. */
clt_status clt_timeline_show(clt_timeline *timeline, const float *drive, int64_t lit_ns, clt_error *error);
/* Drops what ended at or before `before_ns`. */
void clt_timeline_forget(clt_timeline *timeline, int64_t before_ns);

/* Mean radiance of a band of an exposure over its time: each pattern by its share of it. */
void clt_timeline_expose(clt_timeline *timeline, const clt_band *band, clt_exposure *exposure);

#endif
