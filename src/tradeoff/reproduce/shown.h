/* A shipped scene's exact transport, as the figures of scenes use it. */
#ifndef CLT_REPRODUCE_SHOWN_H
#define CLT_REPRODUCE_SHOWN_H

#include "counterlight/scene.h"
#include "counterlight/solve.h"
#include "tradeoff/reproduce/figures.h"

typedef struct clt_shown {
  clt_scene *scene;
  const clt_transport *transport; /* of the scene */
  clt_transport_info info;
  clt_certificate *certificate;
  double *drive, *light, *answer; /* channels * cells values each */
} clt_shown;

/* Opens options->scenes/NAME.cfg and certifies its T. shown is initialised here and finished by the caller in either
 * case. */
clt_status clt_shown_open(const clt_reproduce_options *options, const char *name, clt_shown *shown, clt_error *error);
void clt_shown_close(clt_shown *shown);

/* Paints count pictures (channels * cells values each, in a row in values) side by side, each brightened so that half a
 * percent of its values are white. strip is initialised here. */
clt_status clt_shown_strip(const clt_shown *shown, const double *values, int count, clt_image *strip, clt_error *error);

#endif
