/* Which surfaces of a scene exchange light that reaches the picture. */
#ifndef CLT_SIM_SIGHTS_H
#define CLT_SIM_SIGHTS_H

#include "sim/cells.h"

typedef struct clt_sights {
  int facing;     /* pairs of surfaces that face each other */
  int glossy;     /* surfaces with gloss that the camera sees */
  int exchanging; /* surfaces that exchange light */
  bool *exchange; /* of each surface: it does */
} clt_sights;

/* Two surfaces exchange light where they face each other, both reflect in some channel, and something is open between
 * them; one that the camera sees and that is glossy takes light from every other that it faces. Of those only the ones
 * count that are joined by such pairs with a surface that is lit and with one that is seen: light of the others does
 * not reach the picture. sights was zeroed by the caller and is finished by it in either case. */
clt_status clt_sights_init(clt_sights *sights, const clt_scene_description *description,
                           const clt_visibility *visibility, const clt_cells *cells, clt_error *error);
void clt_sights_finish(clt_sights *sights);

#endif
