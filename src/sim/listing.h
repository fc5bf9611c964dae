/* Finds what every cell has to do with the elements that surfaces are divided into. */
#ifndef CLT_SIM_LISTING_H
#define CLT_SIM_LISTING_H

#include "sim/cells.h"
#include "sim/division.h"
#include "sim/weights.h"

/* Lists of one making; the mirrors of channel c from number CLT_LIST_MIRRORS on. */
enum { CLT_LIST_LIGHTS, CLT_LIST_SEES, CLT_LIST_MIRRORS, CLT_LISTS = CLT_LIST_MIRRORS + CLT_SIM_CHANNELS_MAX };

typedef struct clt_listing {
  const clt_scene_description *description;
  const clt_visibility *visibility;
  const clt_division *divisions; /* of each surface */
  int elements;
  /* Below: filled in. */
  bool sees;         /* what the camera sees is another list than what the projector lights */
  int mirror_planes; /* lists of mirrors: none without gloss, one where every channel's gloss is alike */
  clt_weights list[CLT_LISTS];
} clt_listing;

/* Traces the cells and makes the lists (clt_mesh says what each holds). False where memory is short. The lists are the
 * caller's in either case. */
bool clt_listing_make(clt_listing *listing, const clt_cells *cells);

#endif
