/* The configuration, the daemon, and who may talk to it. */
#include <errno.h>
#include <grp.h>
#include <pwd.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.h"
#include "base/places.h"
#include "base/settings.h"
#include "cli/doctor.h"
#include "cli/link.h"

extern char **environ;

/* The daemon beside this program (or, in a build tree, in the folder beside its own), else the one of PATH. */
static void find_daemon(char *out) {
  static const char *const places[] = {"counterlightd", "../daemon/counterlightd", "../sbin/counterlightd"};
  char program[CLT_PATH_MAX] = "", folder[CLT_PATH_MAX];
  ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
  clt_file_folder(length > 0 ? program : "", folder);
  for (size_t k = 0; k < sizeof places / sizeof places[0]; k++) {
    if (clt_file_join(folder, places[k], out, NULL) == CLT_OK && access(out, X_OK) == 0) {
      return;
    }
  }
  snprintf(out, CLT_PATH_MAX, "counterlightd");
}

/* Runs `counterlightd --config path --check`; line is what it said, and the result its exit code, -1 where it did not
 * run. */
static int check_with_daemon(const char *path, char *line, size_t size) {
  char program[CLT_PATH_MAX];
  int ends[2], state = 0;
  pid_t child = -1;
  find_daemon(program);
  char *const words[] = {program, "--config", (char *)(size_t)path, "--check", NULL};
  line[0] = '\0';
  if (pipe(ends) != 0) {
    return -1;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  posix_spawn_file_actions_addclose(&actions, ends[1]);
  int problem = posix_spawnp(&child, program, &actions, NULL, words, environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  FILE *said = fdopen(ends[0], "r");
  if (problem == 0 && said != NULL && fgets(line, (int)size, said) != NULL) {
    line[strcspn(line, "\n")] = '\0';
  }
  if (said != NULL) {
    fclose(said);
  }
  return problem == 0 && waitpid(child, &state, 0) == child && WIFEXITED(state) ? WEXITSTATUS(state) : -1;
}

/* The daemon's lines begin with the journal's level and its own name. */
static const char *plain(const char *line) {
  static const char name[] = "counterlightd: ";
  line += line[0] == '<' && line[1] != '\0' && line[2] == '>' ? 3 : 0;
  return strncmp(line, name, sizeof name - 1) == 0 ? line + sizeof name - 1 : line;
}

static void check_daemon(doctor *self) {
  char line[CLT_MESSAGE_MAX];
  int code = check_with_daemon(self->path, line, sizeof line);
  if (code == 0) {
    doctor_find(self, DOCTOR_GOOD, NULL, "%s", plain(line));
  } else if (code < 0 || code == 127) {
    doctor_find(self, DOCTOR_NOTE, "install counterlightd, or put it on PATH",
                "%s can be read; counterlightd, which would check its section daemon, was not found", self->path);
  } else {
    doctor_find(self, DOCTOR_PROBLEM, "correct the file (docs/configuration.md)", "%s", plain(line));
  }
}

static bool has_daemon_section(const char *path) {
  clt_settings *settings = NULL;
  bool has =
      clt_settings_open(path, &settings, NULL) == CLT_OK && clt_section_has(clt_settings_root(settings), "daemon");
  clt_settings_close(settings);
  return has;
}

void doctor_look_at_configuration(doctor *self) {
  clt_error error = {0};
  if (self->path == NULL) {
    doctor_find(self, DOCTOR_NOTE, "give --config FILE to have it checked against this machine",
                "no configuration was named");
    return;
  }
  if (clt_station_read(self->path, &self->config, &error) != CLT_OK) {
    doctor_find(self, DOCTOR_PROBLEM, "correct the file (docs/configuration.md)", "%s", error.message);
    return;
  }
  self->configured = true;
  doctor_find(self, DOCTOR_GOOD, NULL, "projector by the driver \"%s\", camera by \"%s\"",
              self->config.projector.driver, self->config.camera.driver);
  if (has_daemon_section(self->path)) {
    check_daemon(self);
  } else {
    doctor_find(self, DOCTOR_NOTE, "add a section daemon = { content = \"picture.png\"; } for counterlightd",
                "%s serves the commands only", self->path);
  }
}

/* Whether this process is in the group, which exists. */
static bool in_group(gid_t group) {
  gid_t groups[256];
  int count = getgroups(sizeof groups / sizeof groups[0], groups);
  bool is_in = getegid() == group;
  for (int k = 0; k < count; k++) {
    is_in = is_in || groups[k] == group;
  }
  return is_in;
}

static void look_at_group(doctor *self, const char *name, const char *opens, json_t *list) {
  const struct group *group = getgrnam(name);
  const struct passwd *user = getpwuid(geteuid());
  char advice[CLT_MESSAGE_MAX];
  bool is_in = group != NULL && in_group(group->gr_gid);
  json_object_set_new(list, name, group == NULL ? json_null() : json_boolean(is_in));
  if (group == NULL || is_in || geteuid() == 0) {
    return;
  }
  snprintf(advice, sizeof advice, "sudo usermod -aG %s %s, then log in again (the service is in it by itself)", name,
           user != NULL ? user->pw_name : "USER");
  doctor_find(self, DOCTOR_NOTE, advice, "this user is not in the group %s, which opens %s", name, opens);
}

/* A kind of node that this user may not open is a finding; none at all is one of the devices. */
static void look_at_nodes(doctor *self, const char *folder, const char *prefix, const char *driver,
                          const char *advice) {
  char path[64], refused[256] = "";
  int count = 0;
  for (int k = 0; k < 256; k++) {
    snprintf(path, sizeof path, "%s/%s%d", folder, prefix, k);
    if (access(path, F_OK) != 0) {
      continue;
    }
    count++;
    size_t used = strlen(refused);
    if (access(path, R_OK | W_OK) != 0 && used + strlen(path) + 2 < sizeof refused) {
      snprintf(refused + used, sizeof refused - used, "%s%s", used > 0 ? " " : "", path);
    }
  }
  if (refused[0] != '\0') {
    doctor_find(self, doctor_level_of(self, driver, DOCTOR_WARNING), advice, "this user may not open %s", refused);
  } else if (count > 0) {
    doctor_find(self, DOCTOR_GOOD, NULL, "%s/%s*: %d, all open to this user", folder, prefix, count);
  }
}

void doctor_look_at_access(doctor *self) {
  json_t *groups = json_object();
  const struct passwd *user = getpwuid(geteuid());
  look_at_group(self, "video", "cameras", groups);
  look_at_group(self, "render", "graphics cards", groups);
  look_at_group(self, "counterlight", "the daemon's socket", groups);
  look_at_nodes(self, "/dev", "video", "v4l2", "join the group video");
  look_at_nodes(self, "/dev", "media", "libcamera", "join the group video");
  look_at_nodes(self, "/dev/dri", "renderD", "glfw", "join the group render");
  if (geteuid() == 0) {
    doctor_find(self, DOCTOR_NOTE,
                "run it once more as the user of the service: sudo -u counterlight counterlight "
                "doctor",
                "root may open everything: this says little about the service");
  }
  json_object_set_new(
      self->document, "access",
      json_pack("{s:s, s:i, s:o}", "user", user != NULL ? user->pw_name : "", "uid", (int)geteuid(), "groups", groups));
}

void doctor_look_at_service(doctor *self) {
  cli_link connection;
  clt_error error = {0};
  json_t *status = NULL;
  struct stat about;
  if (cli_link_open(NULL, &connection, &error) != CLT_OK) {
    char path[CLT_PATH_MAX];
    bool there = clt_place_socket(path, NULL) == CLT_OK && stat(path, &about) == 0;
    bool refused = there && access(path, W_OK) != 0;
    doctor_find(self, refused ? DOCTOR_WARNING : DOCTOR_NOTE,
                refused ? "join the group counterlight" : "sudo systemctl start counterlight", "%s", error.message);
    json_object_set_new(self->document, "daemon", json_null());
    return;
  }
  if (cli_link_call(&connection, "status", NULL, -1, &status, &error) == CLT_OK) {
    const char *state = json_string_value(json_object_get(status, "state"));
    doctor_find(self, DOCTOR_GOOD, NULL, "the daemon at %s is %s", connection.path, state != NULL ? state : "there");
    json_object_set(self->document, "daemon", status);
  } else {
    doctor_find(self, DOCTOR_WARNING, "journalctl -u counterlight", "%s", error.message);
    json_object_set_new(self->document, "daemon", json_null());
  }
  json_decref(status);
  cli_link_close(&connection);
}
