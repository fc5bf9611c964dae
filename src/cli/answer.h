/* Parts of the commands' JSON answers and of their printed ones. */
#ifndef CLT_CLI_ANSWER_H
#define CLT_CLI_ANSWER_H

#include <jansson.h>

#include "cli/picture.h"
#include "counterlight/solve.h"
#include "counterlight/transport.h"

/* A number, or null where it is not finite. */
json_t *cli_json_number(double value);
/* {width, height, channels} */
json_t *cli_json_grid(const cli_grid *grid);
/* count numbers */
json_t *cli_json_numbers(const double *values, int count);
/* Adds error_before, error_after, error_limit, clipped_fraction, method, reason, iterations, products, solve_ms,
 * residual, converged and white to an object. */
void cli_json_add_compensation(json_t *object, const clt_compensation *compensation, int channels);
/* A transport's provenance; what is not known is left out. */
json_t *cli_json_provenance(const clt_provenance *origin);

#endif
