/* A live solver from inside: what every form of it shares, and the forms. */
#ifndef CLT_SOLVE_LIVE_H
#define CLT_SOLVE_LIVE_H

#include <stdint.h>

#include "counterlight/live.h"

/* How a frame is solved: with far light of low rank ("hierarchy" storage), or with products of any transport. */
typedef struct clt_live_form {
  clt_status (*create)(clt_live *live, clt_error *error);
  void (*destroy)(clt_live *live); /* accepts half-built ones */
  void (*reset)(clt_live *live);
  /* Fills drive and all of result but total_ms and error. Hands the target's size to clt_live_measure. */
  clt_status (*solve)(clt_live *live, const float *target, float *drive, clt_live_result *result, clt_error *error);
} clt_live_form;

extern const clt_live_form clt_live_hierarchic, clt_live_general;

struct clt_live {
  const clt_transport *transport;
  clt_transport *made; /* the hierarchy, where the transport is another storage; NULL where it serves itself */
  const clt_certificate *certificate;
  clt_transport_info info;
  clt_live_options options; /* with the defaults put in */
  const clt_live_form *form;
  void *own;         /* the form's */
  int64_t start_ns;  /* of the frame */
  double white_norm; /* ||white|| over lit cells of every channel */
  double size;       /* ||target|| of the frame over the same, or that of a target that is black */
  double seen;       /* ||T drive|| over the same, relative to ||target||: the form's part of the estimate */
};

/* Takes ||target||^2 over lit cells of every channel; CLT_BAD_INPUT where it is not finite, which it shall not be where
 * a value of the target is not, dark cells included. */
clt_status clt_live_measure(clt_live *live, double squares, clt_error *error);

/* The passes over a hierarchy that a frame is made of: the target taken, the drive moved, far light collected and
 * spread, the light of the drive and what is left. */
typedef enum clt_live_pass_name {
  CLT_LIVE_PASS_AIM,
  CLT_LIVE_PASS_MOVE,
  CLT_LIVE_PASS_GATHER,
  CLT_LIVE_PASS_LIGHT,
  CLT_LIVE_PASS_LOOK,
  CLT_LIVE_PASSES
} clt_live_pass_name;

typedef struct clt_live_pass {
  const char *name;
  double bytes, seconds; /* that it reads and writes, and took */
} clt_live_pass;

/* Runs each pass once on what the last frame left, for `target`, and forgets the last drive. False, with nothing done,
 * where frames do not go by a hierarchy. */
bool clt_live_time_passes(clt_live *live, const float *target, clt_live_pass pass[CLT_LIVE_PASSES]);

#endif
