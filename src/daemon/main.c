/* counterlightd: keeps a compensated picture on a projector, unattended. */
#include <cblas.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <ucontext.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/memory.h"
#include "base/places.h"
#include "daemon/control.h"
#include "daemon/measure.h"
#include "daemon/moving.h"
#include "daemon/options.h"
#include "daemon/output.h"
#include "daemon/probe.h"
#include "daemon/solver.h"

enum { EXIT_BAD_INPUT = 2 };

/* All that lives as long as the daemon. */
typedef struct daemon_parts {
  store state;
  listener listening;
  daemon_boxes boxes;
  solver solving;
  output *showing;
  control *controlling;
} daemon_parts;

static int report(const clt_error *error) {
  clt_log(CLT_LOG_ERROR, "counterlightd: %s", error->message);
  return error->status == CLT_BAD_INPUT ? EXIT_BAD_INPUT : EXIT_FAILURE;
}

static int check(const daemon_config *config) {
  clt_error error = {0};
  if (daemon_config_check(config, &error) != CLT_OK) {
    return report(&error);
  }
  printf("%s: OK\n", config->path);
  return EXIT_SUCCESS;
}

/* The folder of a socket that is bound here may be missing; a failure shows at binding. */
static void make_socket_folder(const char *path) {
  char folder[CLT_PATH_MAX];
  clt_file_folder(path, folder);
  clt_place_make_folder(folder, 0755, NULL);
}

static clt_status open_parts(const daemon_config *config, const daemon_overrides *overrides, daemon_parts *parts,
                             clt_error *error) {
  make_socket_folder(config->socket);
  clt_status status = listener_open(config->socket, config->group, &parts->listening, error);
  status = status == CLT_OK ? store_open(config->state, &parts->state, error) : status;
  status = status == CLT_OK ? daemon_boxes_init(&parts->boxes, error) : status;
  status =
      status == CLT_OK ? solver_init(&parts->boxes, &parts->state, config->content, &parts->solving, error) : status;
  status = status == CLT_OK ? output_create(&parts->boxes, &parts->showing, error) : status;
  return status == CLT_OK ? control_create(&parts->boxes, &parts->listening, config, overrides,
                                           parts->solving.shown.name, &parts->controlling, error)
                          : status;
}

static void close_parts(daemon_parts *parts) {
  control_destroy(parts->controlling);
  output_destroy(parts->showing);
  solver_finish(&parts->solving);
  daemon_boxes_finish(&parts->boxes);
  store_close(&parts->state);
  listener_close(&parts->listening);
}

/* Presents until the order to stop, then waits for the other threads: measure first, which may be waiting for a pattern
 * to be shown; control last, which ends the process where that takes too long. */
static clt_status run_threads(daemon_parts *parts, clt_error *error) {
  pthread_t measuring, solving, moving, controlling;
  if (pthread_create(&measuring, NULL, measure_run, &parts->boxes) != 0 ||
      pthread_create(&solving, NULL, solver_run, &parts->solving) != 0 ||
      pthread_create(&moving, NULL, moving_run, &parts->boxes) != 0 ||
      pthread_create(&controlling, NULL, control_run, parts->controlling) != 0) {
    return clt_fail(error, CLT_FAILED, "a thread cannot be started; the system is short of memory or processes");
  }
  output_run(parts->showing);
  clt_mailbox_close(parts->boxes.answers);
  pthread_join(measuring, NULL);
  pthread_join(solving, NULL);
  pthread_join(moving, NULL);
  output_frames *last = clt_alloc(1, sizeof *last);
  if (last != NULL) {
    last->ended = true;
    daemon_report(&parts->boxes, parts->boxes.frames, last);
  }
  pthread_join(controlling, NULL);
  return CLT_OK;
}

/* Runs in a thread that a library started before main and that therefore takes signals (OpenBLAS has such): it blocks
 * the signal there and passes it on, until only the control loop's descriptor is left to take it. */
static void pass_on(int number, siginfo_t *info, void *interrupted) {
  (void)info;
  sigaddset(&((ucontext_t *)interrupted)->uc_sigmask, number);
  kill(getpid(), number);
}

/* Signals are taken by the control loop (signalfd); every thread that is started later inherits this. */
static void block_signals(void) {
  static const int numbers[] = {SIGTERM, SIGINT, SIGHUP};
  const struct sigaction action = {.sa_sigaction = pass_on, .sa_flags = SA_SIGINFO | SA_RESTART};
  sigset_t taken;
  sigemptyset(&taken);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
    sigaddset(&taken, numbers[i]);
  }
  pthread_sigmask(SIG_BLOCK, &taken, NULL);
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
    sigaction(numbers[i], &action, NULL);
  }
  signal(SIGPIPE, SIG_IGN);
}

static int serve(const daemon_config *config, const daemon_overrides *overrides) {
  daemon_parts parts = {.listening.descriptor = -1, .state.lock = -1, .boxes.wake = -1};
  clt_error error = {0};
  openblas_set_num_threads(1); /* counterlight/live.h */
  clt_status status = open_parts(config, overrides, &parts, &error);
  status = status == CLT_OK ? run_threads(&parts, &error) : status;
  if (status != CLT_OK && parts.controlling != NULL) {
    exit(report(&error)); /* threads that have started still use the parts */
  }
  close_parts(&parts);
  return status == CLT_OK ? EXIT_SUCCESS : report(&error);
}

int main(int count, char **arguments) {
  daemon_options options;
  daemon_config config;
  clt_error error = {0};
  if (!daemon_options_read(count, arguments, &options)) {
    return EXIT_BAD_INPUT;
  }
  if (options.help) {
    daemon_options_help();
    return EXIT_SUCCESS;
  }
  if (options.version) {
    puts("counterlightd " CLT_VERSION);
    return EXIT_SUCCESS;
  }
  if (options.states) {
    machine_print(stdout);
    return EXIT_SUCCESS;
  }
  if (options.transport != NULL) {
    return probe_run(options.transport);
  }
  block_signals();
  if (daemon_config_read(options.config, &options.overrides, &config, &error) != CLT_OK) {
    return report(&error);
  }
  return options.check ? check(&config) : serve(&config, &options.overrides);
}
