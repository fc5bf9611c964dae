/* Whether exposures of one picture show the same picture. Light is proportional to exposure time, so that every cell
 * that two exposures see has one rate in both, and one that only the shorter sees unsaturated is at least as bright as
 * the longer says. A frame that was torn, that is half dark, or that shows another picture contradicts the others. */
#ifndef CLT_RIG_AGREEMENT_H
#define CLT_RIG_AGREEMENT_H

#include "rig/merge.h"

/* Workspace; a zeroed one is valid and empty. */
typedef struct clt_agreement {
  int width, height;      /* of the grid */
  float *rate;            /* of both exposures, [(exposure * height + y) * width + x] */
  float *variance, *bias; /* likewise */
  uint8_t *dazzled;       /* cells that a channel of either exposure saturates in, or in a cell beside */
  uint8_t *doubtful;      /* values [c * cells + i] that contradicted each other when last looked at */
} clt_agreement;

clt_status clt_agreement_init(clt_agreement *agreement, int width, int height, int channels, clt_error *error);
void clt_agreement_finish(clt_agreement *agreement);

/* Compares every pair of the merge's exposures and marks in bad[] every one that contradicts another: two that were
 * torn alike outvote one that was not, so that all are taken again. Returns how many values (cells of a channel)
 * contradict each other in the worst pair, or rows' sums where these alone do; 0: all agree. doubtful is set. */
size_t clt_agreement_check(clt_agreement *agreement, const clt_merge *merge, bool bad[CLT_EXPOSURES_MAX]);

#endif
