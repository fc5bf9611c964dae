/* Which surface each cell of the projector's picture shows to the camera. */
#ifndef CLT_SIM_SHOWN_H
#define CLT_SIM_SHOWN_H

#include "sim/cells.h"

/* Columns and rows first <= k <= last of the picture; none where first > last. */
typedef struct clt_shown_part {
  int first_column, last_column, first_row, last_row;
} clt_shown_part;

typedef struct clt_shown {
  int width, height, surfaces;
  int *surface; /* of each cell: the one that most of what the camera sees lit there belongs to; -1: it sees nothing */
  clt_shown_part *part; /* of each surface: around the cells that show it; one more: around those that show any */
} clt_shown;

/* visibility is of the description's surfaces. shown was zeroed by the caller and is finished by it in either case. */
clt_status clt_shown_init(clt_shown *shown, const clt_scene_description *description, const clt_visibility *visibility,
                          clt_error *error);
void clt_shown_finish(clt_shown *shown);

/* The cell that shows the surface and lies nearest in the picture to another cell, or of a surface that no cell shows
 * the nearest that shows any; -1 where none does. */
int clt_shown_nearest(const clt_shown *shown, int surface, int column, int row);

#endif
