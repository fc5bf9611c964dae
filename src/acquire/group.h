/* Photographs that are checked together. Light adds up: what a sum of drives shows is the sum of what each showed, so
 * that one photograph of it tells whether any of them was disturbed. */
#ifndef CLT_ACQUIRE_GROUP_H
#define CLT_ACQUIRE_GROUP_H

#include <stdbool.h>

#include "counterlight/image.h"
#include "counterlight/status.h"

typedef struct clt_group {
  long count;                /* photographs in it */
  double weight, size;       /* the sum of their weights, and of their absolute values */
  clt_image drive;           /* sum of weight x drive */
  clt_image light, variance; /* sums of weight x (seen - black) and of weight^2 x deviation^2 */
} clt_group;

clt_status clt_group_init(clt_group *group, int channels, int height, int width, clt_error *error);
void clt_group_finish(clt_group *group); /* accepts a zeroed one */
void clt_group_clear(clt_group *group);

/* Whether the sum of drives is one itself: of zeros and ones, which no panel rounds. */
bool clt_group_is_drive(const clt_group *group);
/* The weight with which a drive of zeros and ones may be added to such a sum: 1 where they have no lit cell in common,
 * -1 where all of its cells are lit in the sum, 0 where neither leaves a drive. */
double clt_group_fit(const clt_group *group, const clt_image *drive);
/* Whether another photograph would make the error of black, which is in all of them, outweigh their own noise. */
bool clt_group_is_full(const clt_group *group, const clt_image *black_variance);
void clt_group_add(clt_group *group, double weight, const clt_image *drive, const clt_image *seen,
                   const clt_image *deviation, const clt_image *black);

/* Turns light and variance into what a photograph of the drive must show: black, whose error is in all of them, added;
 * and so is `rounding`, clt_rig_info's. Nothing may be added afterwards until it is cleared. */
void clt_group_expect(clt_group *group, const clt_image *black, const clt_image *black_variance, double rounding);
/* Whether both are of the same drive. */
bool clt_group_alike(const clt_group *group, const clt_group *other);

#endif
