#include "transport/rehearsal.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

/* A crash here is an answer: it leaves no core, calls no handler of the program and prints nothing. */
static void expect_crash(unsigned seconds) {
  static const int crashes[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
  for (size_t i = 0; i < sizeof crashes / sizeof crashes[0]; i++) {
    signal(crashes[i], SIG_DFL);
  }
  const struct rlimit no_core = {0, 0}, processor = {seconds, seconds};
  setrlimit(RLIMIT_CORE, &no_core);
  setrlimit(RLIMIT_CPU, &processor);
  int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nowhere >= 0) {
    dup2(nowhere, STDERR_FILENO);
  }
}

static void run_child(clt_status (*act)(void *context, clt_error *error), void *context, unsigned seconds, int answer) {
  clt_error outcome = {CLT_OK, ""};
  expect_crash(seconds);
  act(context, &outcome);
  /* shorter than PIPE_BUF, so that it arrives whole or not at all */
  while (write(answer, &outcome, sizeof outcome) < 0 && errno == EINTR) {
  }
  _exit(0);
}

/* Whether the child's answer comes, rather than the end of the pipe. */
static bool await_answer(int answer, clt_error *outcome) {
  ssize_t count;
  do {
    count = read(answer, outcome, sizeof *outcome);
  } while (count < 0 && errno == EINTR);
  return count == sizeof *outcome;
}

clt_status clt_rehearse(clt_status (*act)(void *context, clt_error *error), void *context, const char *what,
                        unsigned seconds, clt_error *error) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) {
    return CLT_OK;
  }
  pid_t child = fork();
  if (child == 0) {
    run_child(act, context, seconds, ends[1]);
  }
  close(ends[1]);
  clt_error outcome = {CLT_OK, ""};
  bool survived = child < 0 || await_answer(ends[0], &outcome);
  close(ends[0]);
  while (child > 0 && waitpid(child, NULL, 0) < 0 && errno == EINTR) {
  }
  if (!survived) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is damaged, reading it breaks down; copy or write it again", what);
  }
  return outcome.status == CLT_OK ? CLT_OK : clt_fail(error, outcome.status, "%s", outcome.message);
}
