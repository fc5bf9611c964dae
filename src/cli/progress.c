/* Long work: a progress bar on a terminal, and Ctrl-C that ends it cleanly. */
#include "cli/progress.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"

enum { BAR_CELLS = 28 };
static const double redraw_s = 0.1;

static const int stopping_signals[] = {SIGINT, SIGTERM};
enum { STOPPING_SIGNALS = sizeof stopping_signals / sizeof *stopping_signals };

/* Does nothing: SA_RESETHAND makes the kernel itself remember that it was called. Blocking the signals would not do, as
 * the threads of libraries that start them before main would still take them. */
static void remember(int signal_number) {
  (void)signal_number;
}

void cli_progress_begin(cli_progress *progress, bool quiet) {
  struct sigaction once = {.sa_handler = remember, .sa_flags = SA_RESETHAND | SA_RESTART};
  *progress = (cli_progress){.shown = !quiet && isatty(STDERR_FILENO)};
  for (int i = 0; i < STOPPING_SIGNALS; i++) {
    sigaction(stopping_signals[i], NULL, &progress->before[i]);
    if (progress->before[i].sa_handler != SIG_IGN) {
      sigaction(stopping_signals[i], &once, NULL);
    }
  }
}

static void erase(cli_progress *progress) {
  if (progress->drawn) {
    fputs("\r\033[K", stderr);
    progress->drawn = false;
  }
}

void cli_progress_end(cli_progress *progress) {
  erase(progress);
  for (int i = 0; i < STOPPING_SIGNALS; i++) {
    sigaction(stopping_signals[i], &progress->before[i], NULL);
  }
}

bool cli_interrupted(void) {
  for (int i = 0; i < STOPPING_SIGNALS; i++) {
    struct sigaction now;
    if (sigaction(stopping_signals[i], NULL, &now) == 0 && now.sa_handler == SIG_DFL) {
      return true;
    }
  }
  return false;
}

clt_status cli_check_interrupt(clt_error *error) {
  return cli_interrupted() ? clt_fail(error, CLT_CANCELLED, "interrupted; nothing was written") : CLT_OK;
}

void cli_progress_note(cli_progress *progress, const char *what) {
  if (progress->shown) {
    fprintf(stderr, "\r\033[K%s ...", what);
    progress->drawn = true;
  }
}

static void draw(cli_progress *progress, const clt_progress *state) {
  double share = state->total > 0 ? (double)state->done / (double)state->total : 0;
  int filled = (int)(BAR_CELLS * (share > 1 ? 1 : share));
  char bar[BAR_CELLS + 1];
  memset(bar, '.', BAR_CELLS);
  memset(bar, '#', (size_t)filled);
  bar[BAR_CELLS] = '\0';
  fprintf(stderr, "\r\033[Kmeasuring [%s] %s, pattern %ld of about %ld, %.0f s", bar, state->phase, state->done,
          state->total, state->seconds);
  if (state->left >= 0) {
    fprintf(stderr, ", %.0f s left", state->left);
  }
  progress->drawn = true;
  progress->drawn_ns = clt_clock_ns();
}

bool cli_progress_acquire(void *context, const clt_progress *state) {
  cli_progress *progress = context;
  if (progress->shown && (!progress->drawn || clt_clock_since(progress->drawn_ns) >= redraw_s)) {
    draw(progress, state);
  }
  return !cli_interrupted();
}

bool cli_progress_count(cli_progress *progress, const char *phase, int done, int total) {
  if (done == 0) {
    progress->phase_ns = clt_clock_ns();
    cli_progress_note(progress, phase);
    return !cli_interrupted();
  }
  const double seconds = clt_clock_since(progress->phase_ns);
  const clt_progress state = {
      .phase = phase, .done = done, .total = total, .seconds = seconds, .left = seconds * (total - done) / done};
  return cli_progress_acquire(progress, &state);
}
