/* The projector: response of each channel, crosstalk and black, by uniform fields. */
#ifndef CLT_RIG_PHOTOMETRY_PROJECTOR_H
#define CLT_RIG_PHOTOMETRY_PROJECTOR_H

#include "counterlight/panel.h"
#include "rig/photometry/field.h"

enum { CLT_RAMP_LEVELS_LEAST = 17, CLT_RAMP_LEVELS_MOST = 65 };

typedef struct clt_projector_photometry {
  clt_panel panel;
  double black[CLT_PANEL_CHANNELS]; /* light of the dark panel, ambient light included, over that of the white one */
  double additivity;                /* largest of white / (sum of the single channels) - 1, black taken off */
  double drift;                     /* of the reference field over the ramps: largest over smallest, less 1 */
  double seconds;                   /* that the ramps took */
  double largest_fall;              /* by which a level was darker than the one below it, of full drive */
} clt_projector_photometry;

/* Shows `levels` codes of each channel alone (17..65, equidistant as far as the panel's bits allow) at exposures of
 * base_s, which leaves the white panel unsaturated, and 3 and 12 times that where the level leaves room; between them a
 * white reference, by which the lamp's drift is taken out. Each is the mean of `frames` frames less the dark panel's.
 * The bench's response and groups are there. */
clt_status clt_projector_measure(clt_field_bench *bench, double base_s, int levels, int frames,
                                 clt_projector_photometry *out, clt_error *error);

/* Fields that it takes, about: a level takes more than one where a longer exposure turns out to be saturated. */
int clt_projector_fields(int channels, int levels);

#endif
