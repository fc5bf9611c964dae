/* The solving thread: owns the content, the transport and the state directory. */
#ifndef CLT_DAEMON_SOLVER_H
#define CLT_DAEMON_SOLVER_H

#include "daemon/content.h"
#include "daemon/letters.h"

typedef struct solver {
  const daemon_boxes *boxes;
  const store *state;
  content shown;
  daemon_model *model; /* NULL: none in hand */
} solver;

/* Reads the content; CLT_BAD_INPUT where there is none. boxes and state must outlive the solver. */
clt_status solver_init(const daemon_boxes *boxes, const store *state, const char *configured, solver *out,
                       clt_error *error);
void solver_finish(solver *self); /* after its thread has ended; accepts a zeroed one */
/* The thread: works on jobs until one of kind SOLVER_STOP comes. self: a solver. */
void *solver_run(void *self);

#endif
