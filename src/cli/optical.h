/* counterlight compensate without a transport: through the rig. */
#ifndef CLT_CLI_OPTICAL_H
#define CLT_CLI_OPTICAL_H

#include "cli/command.h"

/* The whole of the command where --config or --scene is given in place of a transport. Returns the exit code. */
int cli_compensate_optically(const cli_command *command, const cli_arguments *arguments);

#endif
