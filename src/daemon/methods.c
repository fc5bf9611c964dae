/* What clients may ask. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "daemon/control.h"
#include "daemon/journal.h"

typedef struct method {
  const char *name;
  bool changes;          /* what the daemon does; such requests are logged with who asked */
  const char *params[3]; /* the keys it takes, ended by NULL */
  void (*answer)(control *self, client *from, const rpc_request *request);
} method;

/* Replies with the state that the event leads to, or that the table refuses it. */
static bool accept_event(control *self, client *from, const rpc_request *request, machine_event event) {
  char message[CLT_MESSAGE_MAX];
  const char *before = machine_state_name(self->state);
  bool accepted = control_event(self, event);
  if (accepted) {
    server_reply(from, request, control_state_note(self));
  } else {
    snprintf(message, sizeof message, "cannot %s while %s", request->method, before);
    server_refuse(from, request, RPC_FAILED, message);
  }
  return accepted;
}

static void answer_status(control *self, client *from, const rpc_request *request) {
  server_reply(from, request, control_status(self));
}

/* The kind of measurement that a scope asks for; MEASURE_NOTHING where there is no such scope. */
static measure_kind scope_kind(const char *scope) {
  static const struct {
    const char *name;
    measure_kind kind;
  } scopes[] = {{"transport", MEASURE_ACQUIRE},
                {"photometry", MEASURE_PHOTOMETRY},
                {"geometry", MEASURE_GEOMETRY},
                {"changed", MEASURE_CHANGED}};
  for (size_t i = 0; scope != NULL && i < sizeof scopes / sizeof scopes[0]; i++) {
    if (strcmp(scope, scopes[i].name) == 0) {
      return scopes[i].kind;
    }
  }
  return MEASURE_NOTHING;
}

static void answer_reacquire(control *self, client *from, const rpc_request *request) {
  json_t *param = json_object_get(request->params, "scope");
  measure_kind kind = param == NULL ? MEASURE_ACQUIRE : scope_kind(json_string_value(param));
  if (kind == MEASURE_NOTHING) {
    server_refuse(from, request, RPC_INVALID_PARAMS,
                  "\"scope\" must be \"transport\", \"photometry\", \"geometry\" or \"changed\"");
    return;
  }
  if (kind == MEASURE_GEOMETRY && self->config.station.calibration[0] == '\0') {
    server_refuse(from, request, RPC_FAILED,
                  "there is no geometry to measure again: without a \"calibration\" every cell is a whole number of "
                  "the camera's pixels; for a camera that stands elsewhere run `counterlight calibrate` first");
    return;
  }
  control_wishes before = self->wishes;
  self->wishes.acquire = true;
  self->wishes.scope = kind;
  if (!accept_event(self, from, request, EVENT_REACQUIRE)) {
    self->wishes.acquire = before.acquire;
    self->wishes.scope = before.scope;
  }
}

/* Opens a path that a peer may have opened for it. -1, and the reason, where not. */
static int open_named(const client *from, const char *path, char *message, size_t size) {
  if (!peer_may_name_paths(&from->who)) {
    snprintf(message, size, "a path is opened for root and the daemon's user only; pass the opened file (SCM_RIGHTS)");
    return -1;
  }
  if (path[0] != '/') {
    snprintf(message, size, "\"path\" must be absolute, or the opened file passed along (SCM_RIGHTS)");
    return -1;
  }
  int descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (descriptor < 0) {
    snprintf(message, size, "%s: cannot be read: %s", path, strerror(errno));
  }
  return descriptor;
}

/* The newest wish counts: one that the solver has not begun with is answered as replaced. */
static void wish_content(control *self, client *from, const rpc_request *request, int descriptor, const char *name) {
  control_wishes *wishes = &self->wishes;
  clt_error replaced = {0};
  clt_fail(&replaced, CLT_CANCELLED, "another picture was asked for meanwhile");
  if (wishes->content_descriptor >= 0) {
    close(wishes->content_descriptor);
    server_complete(self->service, WAITS_FOR_CONTENT, wishes->content_ticket, NULL, &replaced);
  }
  wishes->content_descriptor = descriptor;
  wishes->content_ticket = ++self->tickets;
  snprintf(wishes->content_name, sizeof wishes->content_name, "%s", name);
  server_defer(from, request, WAITS_FOR_CONTENT, wishes->content_ticket);
  control_want(self, SOLVER_CONTENT);
}

/* A name goes into the log and into what systemd is told, line by line. */
static bool is_one_line(const char *name) {
  const unsigned char *at = (const unsigned char *)name;
  while (*at >= ' ' && *at != 0x7f) {
    at++;
  }
  return *at == '\0';
}

/* What is wrong with the params of `show`, or NULL. */
static const char *fault_of_show(const char *path, int descriptor) {
  if (path == NULL && descriptor < 0) {
    return "needs {\"path\": \"/picture.png\"}, or the opened file passed along (SCM_RIGHTS)";
  }
  return path == NULL || is_one_line(path) ? NULL : "\"path\" must have no control characters";
}

static void answer_show(control *self, client *from, const rpc_request *request) {
  char message[CLT_MESSAGE_MAX];
  const char *path = json_string_value(json_object_get(request->params, "path"));
  int descriptor = client_take_passed(from);
  const char *fault = fault_of_show(path, descriptor);
  if (fault != NULL) {
    server_refuse(from, request, RPC_INVALID_PARAMS, fault);
    if (descriptor >= 0) {
      close(descriptor);
    }
    return;
  }
  if (descriptor < 0) {
    descriptor = open_named(from, path, message, sizeof message);
  }
  if (descriptor < 0) {
    server_refuse(from, request, RPC_FAILED, message);
    return;
  }
  wish_content(self, from, request, descriptor, path != NULL ? path : "a passed file");
}

static void answer_hold(control *self, client *from, const rpc_request *request) {
  snprintf(self->why, sizeof self->why, "asked to hold");
  accept_event(self, from, request, EVENT_HOLD);
}

static void answer_resume(control *self, client *from, const rpc_request *request) {
  if (self->state == STATE_HOLDING) {
    self->why[0] = '\0';
  }
  accept_event(self, from, request, EVENT_RESUME);
}

/* While the picture is shown it is photographed first. Those who ask before it is written share one snapshot. */
static void answer_snapshot(control *self, client *from, const rpc_request *request) {
  if (self->found.picture.drive.data == NULL || !self->found.calibrated) {
    server_refuse(from, request, RPC_FAILED, "there is no picture yet; ask again when the state is \"showing\"");
    return;
  }
  if (!self->wishes.snapshot && (self->wishes.solver & 1u << SOLVER_SNAPSHOT) == 0) {
    self->wishes.snapshot_ticket = ++self->tickets;
  }
  server_defer(from, request, WAITS_FOR_SNAPSHOT, self->wishes.snapshot_ticket);
  self->wishes.snapshot = true;
  control_event(self, EVENT_VERIFY);
}

/* The picture that is up is photographed, and corrected by what was seen. */
static void answer_refine(control *self, client *from, const rpc_request *request) {
  if (self->state != STATE_SHOWING || !self->found.picture.compensated) {
    server_refuse(from, request, RPC_FAILED, "no compensated picture is up; ask again when the state is \"showing\"");
    return;
  }
  self->wishes.refine = true;
  accept_event(self, from, request, EVENT_VERIFY);
}

static void answer_reload(control *self, client *from, const rpc_request *request) {
  clt_error error = {0};
  const char *restart = NULL;
  if (control_reload(self, &restart, &error) != CLT_OK) {
    server_refuse(from, request, RPC_FAILED, error.message);
    return;
  }
  server_reply(from, request, json_pack("{s:s?, s:s}", "restart", restart, "config", self->config.path));
}

/* Measured once for each picture that was computed; who asks earlier waits. */
static void answer_tradeoff(control *self, client *from, const rpc_request *request) {
  if (self->found.tradeoff != NULL) {
    server_reply(from, request, json_incref(self->found.tradeoff));
  } else if (control_measures_cost(self)) {
    server_defer(from, request, WAITS_FOR_TRADEOFF, 0);
  } else {
    server_refuse(from, request, RPC_FAILED,
                  "no compensated picture is up whose cost could be told; ask again when the state is \"showing\"");
  }
}

static void answer_subscribe(control *self, client *from, const rpc_request *request) {
  from->subscribed = true;
  server_reply(from, request, control_state_note(self));
}

static const method methods[] = {
    {"status", false, {NULL}, answer_status},     {"reacquire", true, {"scope", NULL}, answer_reacquire},
    {"show", true, {"path", NULL}, answer_show},  {"hold", true, {NULL}, answer_hold},
    {"resume", true, {NULL}, answer_resume},      {"snapshot", false, {NULL}, answer_snapshot},
    {"reload", true, {NULL}, answer_reload},      {"subscribe", false, {NULL}, answer_subscribe},
    {"tradeoff", false, {NULL}, answer_tradeoff}, {"refine", true, {NULL}, answer_refine},
};
enum { METHOD_COUNT = sizeof methods / sizeof methods[0] };

static void refuse_unknown(client *from, const rpc_request *request) {
  char message[CLT_MESSAGE_MAX];
  int used = snprintf(message, sizeof message, "there is no method \"%.64s\"; the methods are", request->method);
  for (size_t i = 0; i < METHOD_COUNT; i++) {
    used += snprintf(message + used, sizeof message - (size_t)used, "%s %s", i > 0 ? "," : "", methods[i].name);
  }
  server_refuse(from, request, RPC_UNKNOWN_METHOD, message);
}

/* The first key of params that the method does not take, or NULL. */
static const char *unknown_param(const method *asked, json_t *params) {
  const char *key;
  json_t *value;
  json_object_foreach(params, key, value) {
    size_t i = 0;
    while (asked->params[i] != NULL && strcmp(asked->params[i], key) != 0) {
      i++;
    }
    if (asked->params[i] == NULL) {
      return key;
    }
  }
  return NULL;
}

/* Logs who asked for what. */
static void note_request(const client *from, const char *name) {
  char line[CLT_MESSAGE_MAX], pid[16], uid[16];
  snprintf(line, sizeof line, "control socket: pid %ld uid %ld gid %ld asks to %s", (long)from->who.pid,
           (long)from->who.uid, (long)from->who.gid, name);
  snprintf(pid, sizeof pid, "%ld", (long)from->who.pid);
  snprintf(uid, sizeof uid, "%ld", (long)from->who.uid);
  const journal_field fields[] = {
      {"COUNTERLIGHT_METHOD", name}, {"COUNTERLIGHT_CLIENT_PID", pid}, {"COUNTERLIGHT_CLIENT_UID", uid}};
  journal_note(CLT_LOG_INFO, line, fields, sizeof fields / sizeof fields[0]);
}

void control_on_request(void *context, client *from, const rpc_request *request) {
  size_t i = 0;
  while (i < METHOD_COUNT && strcmp(methods[i].name, request->method) != 0) {
    i++;
  }
  if (i == METHOD_COUNT) {
    refuse_unknown(from, request);
    return;
  }
  const char *unknown = unknown_param(&methods[i], request->params);
  if (unknown != NULL) {
    char message[CLT_MESSAGE_MAX];
    snprintf(message, sizeof message, "%s takes no parameter \"%.64s\"", request->method, unknown);
    server_refuse(from, request, RPC_INVALID_PARAMS, message);
    return;
  }
  if (methods[i].changes) {
    note_request(from, request->method);
  }
  methods[i].answer(context, from, request);
}
