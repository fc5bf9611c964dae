#include "base/places.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char system_socket[] = "/run/counterlight/control.sock";

/* folder and name, or CLT_BAD_INPUT where that is too long. */
static clt_status place(const char *folder, const char *name, char *out, clt_error *error) {
  int used = snprintf(out, CLT_PATH_MAX, "%s%s", folder, name);
  if (used < 0 || used >= CLT_PATH_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%.60s...: the path is longer than %d characters", folder, CLT_PATH_MAX - 1);
  }
  return CLT_OK;
}

/* The value of an environment variable that is set and not empty, or NULL. */
static const char *environment(const char *name) {
  const char *value = getenv(name);
  return value != NULL && value[0] != '\0' ? value : NULL;
}

/* The same with the first folder of a list "a:b", as systemd gives it. */
static clt_status place_first(const char *list, const char *name, char *out, clt_error *error) {
  char folder[CLT_PATH_MAX];
  snprintf(folder, sizeof folder, "%.*s", (int)strcspn(list, ":"), list);
  return place(folder, name, out, error);
}

clt_status clt_place_own_socket(char *out, clt_error *error) {
  const char *runtime = environment("RUNTIME_DIRECTORY"), *user = environment("XDG_RUNTIME_DIR");
  if (runtime != NULL) {
    return place_first(runtime, "/control.sock", out, error);
  }
  if (geteuid() == 0) {
    return place(system_socket, "", out, error);
  }
  if (user != NULL) {
    return place(user, "/counterlight/control.sock", out, error);
  }
  char state[CLT_PATH_MAX];
  clt_status status = clt_place_state(state, error);
  return status == CLT_OK ? place(state, "/control.sock", out, error) : status;
}

clt_status clt_place_socket(char *out, clt_error *error) {
  const char *named = environment("COUNTERLIGHT_SOCKET");
  if (named != NULL) {
    return place(named, "", out, error);
  }
  clt_status status = clt_place_own_socket(out, error);
  return status == CLT_OK && access(out, F_OK) != 0 ? place(system_socket, "", out, error) : status;
}

clt_status clt_place_state(char *out, clt_error *error) {
  const char *given = environment("STATE_DIRECTORY"), *user = environment("XDG_STATE_HOME"),
             *home = environment("HOME");
  if (given != NULL) {
    return place_first(given, "", out, error);
  }
  if (geteuid() == 0) {
    return place("/var/lib/counterlight", "", out, error);
  }
  if (user == NULL && home == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "neither XDG_STATE_HOME nor HOME is set; name a state directory");
  }
  return user != NULL ? place(user, "/counterlight", out, error)
                      : place(home, "/.local/state/counterlight", out, error);
}

clt_status clt_place_make_folder(const char *path, unsigned mode, clt_error *error) {
  char part[CLT_PATH_MAX];
  snprintf(part, sizeof part, "%s", path);
  for (char *slash = part; slash != NULL;) {
    slash = strchr(slash + 1, '/');
    if (slash != NULL) {
      *slash = '\0';
    }
    struct stat found;
    if (stat(part, &found) != 0 && mkdir(part, (mode_t)mode) != 0 && errno != EEXIST) {
      return clt_fail(error, CLT_FAILED, "%s: the folder cannot be made: %s; make it or choose another", part,
                      strerror(errno));
    }
    if (slash != NULL) {
      *slash = '/';
    }
  }
  return CLT_OK;
}
