/* The coded patch: the number of a picture, shown in the picture itself.
 *
 * Eight bits are 8 pairs of blocks of which one is bright and one dark. So no threshold is needed, and the patch sends
 * the same light into the room whatever it says. Successive numbers are Gray-coded: they differ in one bit, and the
 * pairs that stay give the contrast that a picture which is wholly there has. */
#ifndef CLT_RIG_TIMING_PATCH_H
#define CLT_RIG_TIMING_PATCH_H

#include "counterlight/device.h"
#include "counterlight/rig.h"
#include "rig/footprint.h"

enum { CLT_PATCH_BLOCKS = 4, CLT_PATCH_IDS = 256 };

/* CLT_BAD_INPUT where the patch reaches beyond a grid of width x height cells. */
clt_status clt_patch_check(const clt_patch *patch, int width, int height, clt_error *error);
/* Whether a cell belongs to the patch. */
bool clt_patch_covers(const clt_patch *patch, int x, int y);
/* Writes number `id` (modulo 256) over codes of a panel whose grid is width x height cells. */
void clt_patch_write(const clt_patch *patch, int width, int height, const clt_projector_info *panel, long id,
                     float *codes);

/* What a frame's patch says: legible only where all pairs have nearly the same contrast, which a frame exposed across a
 * change of pictures has not. */
typedef struct clt_patch_reading {
  bool saturated; /* blocks are too bright to be told apart: the frame proves nothing */
  bool legible;
  int id;          /* 0..255 */
  double contrast; /* of the least clear pair: (bright - dark) / (bright + dark) */
} clt_patch_reading;
clt_patch_reading clt_patch_read(const clt_patch *patch, int width, const clt_footprints *footprints,
                                 const clt_frame *frame, double black_level);

#endif
