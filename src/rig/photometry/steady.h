/* Frames of one steady picture that agree with each other: what is torn, half dark, late or of another picture is left
 * out and taken again. The first three frames are held and looked at together, two that agree outvoting one that does
 * not; the rest are compared with them. */
#ifndef CLT_RIG_PHOTOMETRY_STEADY_H
#define CLT_RIG_PHOTOMETRY_STEADY_H

#include "rig/shots.h"

enum { CLT_STEADY_HELD = 3, CLT_STEADY_BANDS = 24 };

typedef struct clt_steady {
  clt_shots *shots; /* not owned */
  uint16_t *held;   /* samples of the first frames */
  clt_frame frame[CLT_STEADY_HELD];
  int left[CLT_STEADY_HELD], count, given; /* those of them that agree */
  double reference[CLT_STEADY_BANDS];      /* mean sample of bands of rows, code values */
  int64_t ready_ns;
  double seconds;
} clt_steady;

clt_status clt_steady_init(clt_steady *steady, clt_shots *shots, clt_error *error);
void clt_steady_finish(clt_steady *steady);

/* Takes and compares the first three frames of what is shown from ready_ns on. CLT_FAILED, with their numbers, where no
 * two agree after several rounds. */
clt_status clt_steady_begin(clt_steady *steady, int64_t ready_ns, double seconds, clt_error *error);
/* The next frame that agrees; its samples live until the next call. */
clt_status clt_steady_next(clt_steady *steady, clt_frame *frame, clt_error *error);

#endif
