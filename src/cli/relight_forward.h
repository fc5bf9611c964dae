/* relight --forward: l_out built from A = I - F T^-1 in place of one product with T. */
#ifndef CLT_CLI_RELIGHT_FORWARD_H
#define CLT_CLI_RELIGHT_FORWARD_H

#include "cli/command.h"
#include "cli/transport_input.h"
#include "counterlight/forward.h"

typedef struct cli_forward {
  const char *method; /* "series", "iteration", "montecarlo"; NULL: none was asked for */
  clt_interreflection_options how;
  int bounces, samples, seed;
  double tolerance;

  clt_forward_result result; /* not of montecarlo */
  double difference;         /* ||l - T x|| / ||T x||: how far the light is from the product with T */
  double deviation;          /* montecarlo: root mean square of the standard errors, over that of T x */
} cli_forward;

clt_status cli_forward_read(const cli_command *command, const cli_arguments *arguments, cli_forward *forward,
                            clt_error *error);
/* seen = b0 + l_out of a drive; seen is initialised here. */
clt_status cli_forward_relight(cli_forward *forward, const cli_input *input, const clt_image *drive, clt_image *seen,
                               clt_error *error);
/* What to say of it, as an object for "forward" of the answer. */
json_t *cli_forward_json(const cli_forward *forward);
void cli_forward_print(const cli_forward *forward);

#endif
