/* Long work: a progress bar on a terminal, and Ctrl-C that ends it cleanly. */
#include "cli/progress.h"

#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"

enum { BAR_CELLS = 28 };
static const double redraw_s = 0.1;

static void stopping_signals(sigset_t *set) {
  sigemptyset(set);
  sigaddset(set, SIGINT);
  sigaddset(set, SIGTERM);
}

void cli_progress_begin(cli_progress *progress, bool quiet) {
  sigset_t stopping;
  stopping_signals(&stopping);
  *progress = (cli_progress){.shown = !quiet && isatty(STDERR_FILENO)};
  pthread_sigmask(SIG_BLOCK, &stopping, &progress->before);
}

static void erase(cli_progress *progress) {
  if (progress->drawn) {
    fputs("\r\033[K", stderr);
    progress->drawn = false;
  }
}

void cli_progress_end(cli_progress *progress) {
  sigset_t stopping;
  stopping_signals(&stopping);
  erase(progress);
  if (cli_interrupted()) {
    sigtimedwait(&stopping, NULL, &(struct timespec){0});
  }
  pthread_sigmask(SIG_SETMASK, &progress->before, NULL);
}

bool cli_interrupted(void) {
  sigset_t pending;
  return sigpending(&pending) == 0 && (sigismember(&pending, SIGINT) == 1 || sigismember(&pending, SIGTERM) == 1);
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
