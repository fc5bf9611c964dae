/* Which pattern lights the room when. Times in ns of the scene's clock. */
#ifndef CLT_SIM_TIMELINE_H
#define CLT_SIM_TIMELINE_H

#include "sim/appearance.h"

/* A pattern that lights the room from lit_ns until the next one does. */
typedef struct clt_lighting {
  struct clt_lighting *next;
  int64_t lit_ns;
  bool computed;           /* radiance holds its appearance */
  float *drive, *radiance; /* channels * cells values */
} clt_lighting;

typedef struct clt_timeline {
  clt_appearance *appearance; /* outlives the timeline */
  size_t values;              /* channels * cells */
  clt_lighting *first, *last; /* by ascending time; never empty after init */
  clt_lighting *spare;        /* forgotten ones, to be used again */
} clt_timeline;

/* Starts with a dark panel since ever. timeline was zeroed by the caller and is finished by it in either case. */
clt_status clt_timeline_init(clt_timeline *timeline, clt_appearance *appearance, clt_error *error);
void clt_timeline_finish(clt_timeline *timeline);

/* From lit_ns on (not before any earlier one) the room is lit by drive, which is copied. */
clt_status clt_timeline_show(clt_timeline *timeline, const float *drive, int64_t lit_ns, clt_error *error);
/* Drops what ended at or before `before_ns`. */
void clt_timeline_forget(clt_timeline *timeline, int64_t before_ns);

/* Mean radiance over start_ns <= time < end_ns (end > start): each pattern by its share of the time. */
void clt_timeline_expose(clt_timeline *timeline, int64_t start_ns, int64_t end_ns, float *radiance);

#endif
