/* Long work: a progress bar on a terminal, and Ctrl-C that ends it cleanly. */
#ifndef CLT_CLI_PROGRESS_H
#define CLT_CLI_PROGRESS_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>

#include "counterlight/acquire.h"

typedef struct cli_progress {
  bool shown;                 /* stderr is a terminal and the command is not quiet */
  bool drawn;                 /* a bar stands on the terminal's last line */
  int64_t drawn_ns;           /* when */
  int64_t phase_ns;           /* when the phase began that is counted */
  struct sigaction before[2]; /* what SIGINT and SIGTERM did before */
} cli_progress;

/* From here on the first SIGINT or SIGTERM is only remembered (cli_interrupted); the second one kills. */
void cli_progress_begin(cli_progress *progress, bool quiet);
/* Takes the bar away and gives the signals back what they did before. */
void cli_progress_end(cli_progress *progress);
/* True where SIGINT or SIGTERM came since cli_progress_begin. */
bool cli_interrupted(void);
/* CLT_CANCELLED with the message where one came, else CLT_OK: asked between two steps of a command. */
clt_status cli_check_interrupt(clt_error *error);
/* Shows what a step without a count is about, in place of the bar. */
void cli_progress_note(cli_progress *progress, const char *what);
/* clt_acquire_options.progress, with a cli_progress as context: draws, and cancels when a signal came. */
bool cli_progress_acquire(void *context, const clt_progress *state);
/* Draws `done` of `total` of a phase, whose time counts from its first report, with done 0, on; false when a signal
 * came. */
bool cli_progress_count(cli_progress *progress, const char *phase, int done, int total);

#endif
