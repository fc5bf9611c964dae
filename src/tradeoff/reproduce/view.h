/* The report's picture of its box: five sides, one red and one green, seen through the open front (Figs. 7 and 11). */
#ifndef CLT_REPRODUCE_VIEW_H
#define CLT_REPRODUCE_VIEW_H

#include "counterlight/image.h"
#include "tradeoff/reproduce/cube.h"

enum { CLT_VIEW_SIDES = 5, CLT_VIEW_CHANNELS = 3, CLT_VIEW_PIXELS = 128 };

/* Of floor, left, back, right and ceiling; the whole stays below the limit of the inverse series. */
extern const double clt_room_view_albedo[CLT_VIEW_CHANNELS][CLT_CUBE_SIDES];

typedef struct clt_room_view {
  size_t cells;
  int *patch; /* that each of CLT_VIEW_PIXELS x CLT_VIEW_PIXELS pixels shows; -1 beside the box */
} clt_room_view;

/* cube has CLT_VIEW_SIDES sides. view was zeroed by the caller and is finished by it in either case. */
clt_status clt_room_view_init(clt_room_view *view, const clt_cube *cube, clt_error *error);
void clt_room_view_finish(clt_room_view *view);

/* Paints offset + gain * light into panel `column` of line `line` of a strip of panels; light has CLT_VIEW_CHANNELS *
 * cells values. */
void clt_room_view_paint(const clt_room_view *view, const double *light, double offset, double gain, int column,
                         int line, clt_image *strip);

#endif
