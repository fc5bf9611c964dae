/* The options that every compensating command takes: --method --tolerance --deadline-ms --white. */
#ifndef CLT_CLI_SOLVE_OPTIONS_H
#define CLT_CLI_SOLVE_OPTIONS_H

#include "cli/command.h"
#include "counterlight/solve.h"

/* Reads those of them that the command has into options and white; the others keep their defaults. */
clt_status cli_solve_options(const cli_command *command, const cli_arguments *arguments, clt_solve_options *options,
                             clt_white *white, clt_error *error);

#endif
