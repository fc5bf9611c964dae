/* The drawing of a tradeoff: log error against log time, the front drawn and labelled, the chosen point marked. */
#ifndef CLT_TRADEOFF_PLOT_H
#define CLT_TRADEOFF_PLOT_H

#include <stdio.h>

#include "counterlight/tradeoff.h"

/* Writes one <svg> element, which brings its own style (light and dark): a file of its own, or part of a page. */
clt_status clt_plot_write(const clt_tradeoff *tradeoff, FILE *to, clt_error *error);

#endif
