/* The options that every compensating command takes: --method --tolerance --deadline-ms --white. */
#include "cli/solve_options.h"

clt_status cli_solve_options(const cli_command *command, const cli_arguments *arguments, clt_solve_options *options,
                             clt_white *white, clt_error *error) {
  double deadline_ms = 0;
  const char *white_text = cli_value(command, arguments, "white");
  *options = (clt_solve_options){.method = cli_value(command, arguments, "method")};
  *white = (clt_white){.kind = CLT_WHITE_AUTO};
  clt_status status = cli_number(command, arguments, "tolerance", 1e-12, 1, &options->tolerance, error);
  if (!status) {
    status = cli_number(command, arguments, "deadline-ms", 0.01, 1e9, &deadline_ms, error);
  }
  options->deadline_s = 1e-3 * deadline_ms;
  if (!status && white_text) {
    status = clt_white_parse(white_text, white, error);
  }
  return status;
}
