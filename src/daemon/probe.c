#include "daemon/probe.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stddef.h>
#include <sys/pidfd.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "counterlight/transport.h"

enum { WHOLE = 0, REFUSED = 2 };

/* Slower than this no disk reads: s to begin with, and bytes per s. */
static const double patience_s = 10, slowest = 4e6;

int probe_run(const char *path) {
  clt_transport *transport = NULL;
  clt_status status = clt_transport_load(path, &transport, NULL);
  clt_transport_destroy(transport);
  return status == CLT_OK ? WHOLE : REFUSED;
}

/* Starts this program anew, with no signals blocked and nowhere to print to; its process, or -1. */
static pid_t start(const char *path) {
  char *arguments[] = {"counterlightd", "--try-transport", (char *)path, NULL};
  pid_t child = -1;
  sigset_t none;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_t files;
  sigemptyset(&none);
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  if (posix_spawn(&child, "/proc/self/exe", &files, &attributes, arguments, environ) != 0) {
    child = -1;
  }
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  return child;
}

/* By whoever stops all of the daemon's processes, which tells nothing of the file. */
static bool was_asked_to_end(int outcome) {
  return WIFSIGNALED(outcome) &&
         (WTERMSIG(outcome) == SIGTERM || WTERMSIG(outcome) == SIGINT || WTERMSIG(outcome) == SIGHUP);
}

bool probe_transport(const char *path) {
  struct stat about;
  double seconds = patience_s + (stat(path, &about) == 0 ? (double)about.st_size / slowest : 0);
  pid_t child = start(path);
  if (child < 0) {
    return true;
  }
  struct pollfd ended = {.fd = pidfd_open(child, 0), .events = POLLIN};
  if (ended.fd >= 0 && poll(&ended, 1, (int)(seconds * 1000)) == 0) {
    kill(child, SIGKILL);
  }
  if (ended.fd >= 0) {
    close(ended.fd);
  }
  int outcome = 0;
  waitpid(child, &outcome, 0);
  bool ended_well = WIFEXITED(outcome) && (WEXITSTATUS(outcome) == WHOLE || WEXITSTATUS(outcome) == REFUSED);
  return ended_well || was_asked_to_end(outcome);
}
