/* A grid shared out into rectangular blocks, and where it pays to cut one in two. */
#ifndef CLT_ACQUIRE_PARTITION_H
#define CLT_ACQUIRE_PARTITION_H

#include <stdbool.h>
#include <stddef.h>

#include "acquire/blocks.h"
#include "counterlight/status.h"

typedef struct clt_partition {
  int width, height, channels;
  const double *scale; /* per channel: what a light of 1 is; owned by the caller */
  int32_t count, most; /* blocks now, and how many there is room for */
  clt_block *box;
  int32_t *label; /* of each cell: its block */
  /* The light of block a as seen in block b, [b * most + a]: its mean, and the variance of its means over four strips
   * from left to right, and from top to bottom; all channels together. */
  double *mean, *across, *down;
  double *variance; /* of one value of a's light, [a] */
} clt_partition;

/* One block that covers the grid. */
clt_status clt_partition_init(clt_partition *partition, int width, int height, int channels, const double *scale,
                              int32_t most, clt_error *error);
void clt_partition_finish(clt_partition *partition); /* accepts a zeroed one */

/* Looks at the light of block a (channels x cells) in block b. */
void clt_partition_look(clt_partition *partition, int32_t b, int32_t a, const float *light);

/* The cut that promises most: block and direction (down: into an upper and a lower half). Returns the rms over the grid
 * of the light that it lets be resolved, or 0 where no cut promises more than noise. */
double clt_partition_choose(const clt_partition *partition, int32_t *block, bool *down);
/* Cuts a block in two; its right or lower half becomes the block numbered count, which is returned. */
int32_t clt_partition_cut(clt_partition *partition, int32_t block, bool down);

#endif
