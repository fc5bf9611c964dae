/* Conjugate gradients, plain or with flat modes deflated. */
#ifndef CLT_SOLVE_PCG_H
#define CLT_SOLVE_PCG_H

#include "solve/method.h"

/* The mode in which all of a room brightens together, one for each channel of a system. */
typedef struct clt_flat_mode {
  int channels;
  size_t count;                     /* cells of a channel */
  double *z, *sz;                   /* the mode and S z, channel after channel */
  double inverse[CLT_CHANNELS_MAX]; /* 1 / <z, S z> in the flux-weighted inner product; 0: no mode in this channel */
} clt_flat_mode;

enum { CLT_CG_VECTORS = 5 };
/* Solves system; `flat` may be NULL. */
clt_outcome clt_cg_run(clt_system *system, clt_run *run, const clt_flat_mode *flat);

#endif
