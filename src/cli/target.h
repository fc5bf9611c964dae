/* The picture that the demo projects when it is given none. */
#ifndef CLT_CLI_TARGET_H
#define CLT_CLI_TARGET_H

#include "cli/picture.h"

/* Draws a harbour at dusk on the grid, linear light in 0..1: what interreflection spoils most is in it, a bright sun
 * beside a dark hillside, saturated stripes, smooth gradients. out is initialised here. */
clt_status cli_target_draw(const cli_grid *grid, clt_image *out, clt_error *error);

#endif
