/* The closed loop: photograph what is shown, and correct it; tell when T no longer fits the room. */
#ifndef COUNTERLIGHT_LOOP_H
#define COUNTERLIGHT_LOOP_H

#include <stdbool.h>

#include "counterlight/image.h"
#include "counterlight/solve.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CLT_LOOP_DELAY_MAX = 32 };

/* The greatest omega sigma at which e+ = e - omega sigma e_(k - delay) dies away: 2 cos(d pi / (2 d + 1)), that is 2,
 * 1, .618, .445, ... for d = 0, 1, 2, 3 (Levin & May, Theoretical Population Biology 9, 1976). delay is cut to
 * 0..CLT_LOOP_DELAY_MAX. */
CLT_PUBLIC double clt_loop_limit(int delay);

typedef struct clt_loop_options {
  double gain;      /* omega, > 0 and below `limit` of clt_loop_describe; 0: half of that */
  int delay;        /* d, 0..CLT_LOOP_DELAY_MAX: a step is given the photograph of the drive d steps before the last */
  bool inverse;     /* correct by T^-1 in place of F^-1: the gain that is stable then depends on no albedo */
  bool predict;     /* add to the photograph what T says of the d steps since (Smith 1957): as if there were no delay */
  double tolerance; /* of the solves with T, relative residual; 0 means 1e-3 */
} clt_loop_options;

/* x+ = x + omega F^-1 (wanted - seen(x_(k - d))), or T^-1 in place of F^-1, kept within 0..1. One call at a time. */
typedef struct clt_loop clt_loop;

typedef struct clt_loop_info {
  double gain, limit; /* omega, and what it must stay below: clt_loop_limit over the greatest eigenvalue that the
                         certificate allows F^-1 T (1 + radius_high), or over 1 with `inverse` */
  int delay;
} clt_loop_info;

/* options may be NULL (all zeros). transport and certificate outlive the loop. CLT_BAD_INPUT where rows != cols, where
 * an option is out of range, and for a gain at or above the limit. */
CLT_PUBLIC clt_status clt_loop_create(const clt_transport *transport, const clt_certificate *certificate,
                                      const clt_loop_options *options, clt_loop **out, clt_error *error);
CLT_PUBLIC void clt_loop_destroy(clt_loop *loop); /* accepts NULL */
CLT_PUBLIC clt_loop_info clt_loop_describe(const clt_loop *loop);

/* Corrects drive (channels * cols values, 0..1): the drive that was shown last, then the next one to show. wanted and
 * seen: channels * rows values, less black; seen is of the drive `delay` steps before (of the first one while there
 * were fewer). A seen value that is not finite says nothing of its cell, whose drive stays. */
CLT_PUBLIC clt_status clt_loop_step(clt_loop *loop, const double *wanted, const double *seen, double *drive,
                                    clt_error *error);

/* Whether one photograph is what T predicts. Figures are relative to ||T x|| over the lit cells that were seen. */
typedef struct clt_fit {
  double off;   /* ||seen - b0 - T x|| */
  double noise; /* what of it is expected: sqrt(sum of deviation^2 + sigma_T^2 ||x||^2) */
  double limit; /* above this T no longer fits: the noise and five standard deviations of its norm, and twice the error
                   that T's own check patterns had when it was measured (provenance.error) */
  size_t cells; /* of all channels, that were compared */
  bool fits;
} clt_fit;

/* Compares the photograph `seen` of `drive` (black included, with its standard deviation; infinite: not seen) with b0 +
 * T drive, where the drive is what the panel showed, by clt_panel_shown: rounding to 8 bits alone changes light by some
 * .2 %. A picture without detail cannot tell that a projector has moved. CLT_BAD_INPUT where sizes differ, rows !=
 * cols, or where no lit cell was seen. */
CLT_PUBLIC clt_status clt_loop_check(const clt_transport *transport, const clt_certificate *certificate,
                                     const clt_image *drive, const clt_image *seen, const clt_image *deviation,
                                     clt_fit *fit, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
