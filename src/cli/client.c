/* counterlight status, reacquire, refine, show, watch, snapshot, hold, resume, reload: talk to a running daemon. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/link.h"

static const cli_option socket_only[] = {
    {"socket", 's', "PATH", "the daemon's control socket (else $COUNTERLIGHT_SOCKET, else the usual one)"},
    {NULL, 0, NULL, NULL},
};

static const char *text_of(const json_t *object, const char *key) {
  const char *text = json_string_value(json_object_get(object, key));
  return text != NULL ? text : "";
}

static double number_of(const json_t *object, const char *key) {
  return json_number_value(json_object_get(object, key));
}

/* One request and its reply. */
static clt_status ask(const cli_command *command, const cli_arguments *arguments, json_t *params, int descriptor,
                      json_t **result, clt_error *error) {
  cli_link connection;
  clt_status status = cli_link_open(cli_value(command, arguments, "socket"), &connection, error);
  if (status != CLT_OK) {
    json_decref(params);
    return status;
  }
  status = cli_link_call(&connection, command->name, params, descriptor, result, error);
  cli_link_close(&connection);
  return status;
}

/* Asks and prints: the result itself with --json, else what `print` makes of it. */
static int ask_and_print(const cli_command *command, const cli_arguments *arguments, json_t *params, int descriptor,
                         void (*print)(const json_t *result)) {
  clt_error error = {0};
  json_t *result = NULL;
  if (ask(command, arguments, params, descriptor, &result, &error) != CLT_OK) {
    return cli_fail(command, &error);
  }
  if (arguments->json) {
    return cli_print_json(result);
  }
  if (!arguments->quiet) {
    print(result);
  }
  json_decref(result);
  return CLI_DONE;
}

static void print_state(const json_t *result) {
  const char *why = text_of(result, "why");
  printf("%s since %s%s%s\n", text_of(result, "state"), text_of(result, "since"), why[0] != '\0' ? ": " : "", why);
}

static void print_progress(const json_t *progress) {
  double left = number_of(progress, "left");
  printf("acquiring: %s, %.0f of %.0f patterns", text_of(progress, "phase"), number_of(progress, "done"),
         number_of(progress, "total"));
  if (number_of(progress, "resumed") > 0) {
    printf(", %.0f from before an interruption", number_of(progress, "resumed"));
  }
  if (json_is_number(json_object_get(progress, "left"))) {
    printf(", %.0f s left", left);
  }
  putchar('\n');
}

static void print_transport(const json_t *transport) {
  const json_t *grid = json_object_get(transport, "grid"), *own = json_object_get(transport, "error");
  if (!json_is_object(transport)) {
    puts("transport  none: the picture is not compensated");
    return;
  }
  printf("transport  %.0f x %.0f cells, %.0f channels, acquired %s with %.0f patterns", number_of(grid, "width"),
         number_of(grid, "height"), number_of(grid, "channels"), text_of(transport, "acquired"),
         number_of(transport, "patterns"));
  if (json_is_number(own)) {
    printf(", its own error %.2g %%", 100 * json_number_value(own));
  }
  putchar('\n');
}

static void print_frame(const json_t *frame) {
  printf("frame      %.1f a second, %.0f late", number_of(frame, "fps"), number_of(frame, "late"));
  if (json_is_number(json_object_get(frame, "error"))) {
    printf(", %.2g %% error by %s in %.3g ms", 100 * number_of(frame, "error"), text_of(frame, "method"),
           number_of(frame, "solve_ms"));
  }
  if (json_is_number(json_object_get(frame, "verified_error"))) {
    printf("; photographed: %.2g %%", 100 * number_of(frame, "verified_error"));
  }
  putchar('\n');
}

static void print_verify(const json_t *verify) {
  const json_t *fits = json_object_get(verify, "fits");
  printf("verified   the picture is %.2g %% off", 100 * number_of(verify, "error"));
  if (json_is_boolean(fits)) {
    printf("; the photograph is %.2g %% off what T predicts, up to %.2g %% is no sign of a change: %s",
           100 * number_of(verify, "off"), 100 * number_of(verify, "limit"),
           json_is_true(fits) ? "T fits" : "T no longer fits the room");
  }
  putchar('\n');
}

static void print_reacquired(const json_t *found) {
  static const char *const sayings[][2] = {{"nothing", "nothing changed"},
                                           {"gain", "black and gain are new"},
                                           {"repaint", "the rows of repainted cells are new"},
                                           {"transport", "all of it was measured"}};
  const char *done = text_of(found, "done");
  for (size_t i = 0; i < sizeof sayings / sizeof sayings[0]; i++) {
    if (strcmp(done, sayings[i][0]) == 0) {
      printf("reacquired %s, by %.0f patterns; T was %.2g %% off\n", sayings[i][1], number_of(found, "patterns"),
             100 * number_of(found, "off_before"));
    }
  }
  const json_t *geometry = json_object_get(found, "geometry");
  if (json_is_true(json_object_get(geometry, "adopted"))) {
    printf("geometry   new: the camera moved by %.2g of its pixels and sees %.3g %% of the panel\n",
           number_of(geometry, "moved"), 100 * number_of(geometry, "covered"));
  } else if (json_is_object(geometry)) {
    printf("geometry   stays: %s\n", text_of(geometry, "why"));
  }
}

static void print_drift(const json_t *drift) {
  if (json_is_object(drift)) {
    printf("drift      in an hour the error grows by %.2g %% (+- %.2g) and the light by %.2g %% (+- %.2g)%s\n",
           100 * number_of(drift, "error_per_hour"), 100 * number_of(drift, "error_deviation"),
           100 * number_of(drift, "brightness_per_hour"), 100 * number_of(drift, "brightness_deviation"),
           json_is_true(json_object_get(drift, "passes")) ? ": more than the limit" : "");
  }
}

static void print_status(const json_t *status) {
  const json_t *devices = json_object_get(status, "devices"), *progress = json_object_get(status, "progress");
  print_state(status);
  if (json_is_object(progress)) {
    print_progress(progress);
  }
  printf("content    %s\n", text_of(status, "content"));
  print_transport(json_object_get(status, "transport"));
  print_frame(json_object_get(status, "frame"));
  if (json_is_object(json_object_get(status, "verify"))) {
    print_verify(json_object_get(status, "verify"));
  }
  print_drift(json_object_get(status, "drift"));
  if (json_is_object(json_object_get(status, "reacquired"))) {
    print_reacquired(json_object_get(status, "reacquired"));
  }
  printf("cost       %s\n", text_of(status, "cost"));
  if (json_is_object(devices)) {
    printf("devices    projector %s, camera %s\n", text_of(devices, "projector"), text_of(devices, "camera"));
  }
}

static void print_snapshot(const json_t *result) {
  static const char *const names[] = {"target", "drive", "observation"};
  for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
    const char *path = text_of(result, names[i]);
    printf("%-12s %s\n", names[i], path[0] != '\0' ? path : "none yet");
  }
}

static void print_content(const json_t *result) {
  printf("%s: %s\n", text_of(result, "state"), text_of(result, "content"));
}

static void print_reload(const json_t *result) {
  const char *restart = text_of(result, "restart");
  printf("%s read again\n", text_of(result, "config"));
  if (restart[0] != '\0') {
    printf("%s changed, which holds from the next start of the daemon on\n", restart);
  }
}

static int run_status(const cli_command *command, const cli_arguments *arguments) {
  return ask_and_print(command, arguments, NULL, -1, print_status);
}

static int run_state(const cli_command *command, const cli_arguments *arguments) {
  return ask_and_print(command, arguments, NULL, -1, print_state);
}

static int run_snapshot(const cli_command *command, const cli_arguments *arguments) {
  return ask_and_print(command, arguments, NULL, -1, print_snapshot);
}

static int run_reload(const cli_command *command, const cli_arguments *arguments) {
  return ask_and_print(command, arguments, NULL, -1, print_reload);
}

/* The picture is opened here, so that the rights of whoever asks count; its path is only its name. */
static int run_show(const cli_command *command, const cli_arguments *arguments) {
  clt_error error = {0};
  const char *path = arguments->positional[0];
  int descriptor = open(path, O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    clt_fail(&error, CLT_BAD_INPUT, "%s: cannot be read: %s", path, strerror(errno));
    return cli_fail(command, &error);
  }
  char *resolved = realpath(path, NULL);
  int outcome = ask_and_print(command, arguments, json_pack("{s:s}", "path", resolved != NULL ? resolved : path),
                              descriptor, print_content);
  free(resolved);
  close(descriptor);
  return outcome;
}

/* One line for a notification, or the document itself. */
static void print_notification(const json_t *notification, const cli_arguments *arguments) {
  static const struct {
    const char *method;
    void (*print)(const json_t *params);
  } prints[] = {{"state", print_state},
                {"progress", print_progress},
                {"verify", print_verify},
                {"reacquired", print_reacquired},
                {"drift", print_drift}};
  const char *method = text_of(notification, "method");
  for (size_t i = 0; !arguments->json && !arguments->quiet && i < sizeof prints / sizeof prints[0]; i++) {
    if (strcmp(method, prints[i].method) == 0) {
      prints[i].print(json_object_get(notification, "params"));
    }
  }
  if (arguments->json) {
    json_dumpf(notification, stdout, JSON_COMPACT);
    putchar('\n');
  }
  fflush(stdout);
}

/* Prints notifications until one says a state that `enough` accepts; *last (the caller's) is what it says. `first` is
 * the state at the beginning, taken over: it is printed and counts like a notification. */
static clt_status follow(cli_link *connection, const cli_arguments *arguments, json_t *first,
                         bool (*enough)(const char *state, const void *context), const void *context, json_t **last,
                         clt_error *error) {
  json_t *notification = json_pack("{s:s, s:s, s:o}", "jsonrpc", "2.0", "method", "state", "params", first);
  clt_status status = CLT_OK;
  *last = NULL;
  while (status == CLT_OK && *last == NULL) {
    json_t *params = json_object_get(notification, "params");
    print_notification(notification, arguments);
    if (strcmp(text_of(notification, "method"), "state") == 0 && enough(text_of(params, "state"), context)) {
      *last = json_incref(params);
    }
    json_decref(notification);
    notification = NULL;
    status = *last == NULL ? cli_link_next(connection, &notification, error) : CLT_OK;
  }
  return status;
}

static bool is_wanted(const char *state, const void *wanted) {
  return wanted != NULL && strcmp(state, wanted) == 0;
}

static int run_watch(const cli_command *command, const cli_arguments *arguments) {
  clt_error error = {0};
  cli_link connection;
  json_t *first = NULL, *last = NULL;
  clt_status status = cli_link_open(cli_value(command, arguments, "socket"), &connection, &error);
  if (status == CLT_OK) {
    status = cli_link_call(&connection, "subscribe", NULL, -1, &first, &error);
  }
  if (status == CLT_OK) {
    status = follow(&connection, arguments, first, is_wanted, cli_value(command, arguments, "until"), &last, &error);
  }
  json_decref(last);
  cli_link_close(&connection);
  return status == CLT_OK ? CLI_DONE : cli_fail(command, &error);
}

/* States in which an acquisition that was asked for is still on its way. */
static bool is_settled(const char *state, const void *context) {
  static const char *const moving[] = {"opening", "calibrating", "acquiring", "solving"};
  (void)context;
  for (size_t i = 0; i < sizeof moving / sizeof moving[0]; i++) {
    if (strcmp(state, moving[i]) == 0) {
      return false;
    }
  }
  return true;
}

static json_t *scope_params(const cli_command *command, const cli_arguments *arguments) {
  const char *scope = cli_value(command, arguments, "scope");
  return scope != NULL ? json_pack("{s:s}", "scope", scope) : NULL;
}

static clt_status reacquire_and_wait(const cli_command *command, const cli_arguments *arguments, json_t **last,
                                     clt_error *error) {
  cli_link connection;
  json_t *reply = NULL, *begun = NULL;
  clt_status status = cli_link_open(cli_value(command, arguments, "socket"), &connection, error);
  status = status == CLT_OK ? cli_link_call(&connection, "subscribe", NULL, -1, &reply, error) : status;
  status = status == CLT_OK
               ? cli_link_call(&connection, "reacquire", scope_params(command, arguments), -1, &begun, error)
               : status;
  status = status == CLT_OK ? follow(&connection, arguments, begun, is_settled, NULL, last, error) : status;
  if (status == CLT_OK && strcmp(text_of(*last, "state"), "showing") != 0) {
    status = clt_fail(error, CLT_FAILED, "the acquisition ended in state %s: %s; the earlier picture stays up",
                      text_of(*last, "state"), text_of(*last, "why"));
  }
  json_decref(reply);
  cli_link_close(&connection);
  return status;
}

static int run_reacquire(const cli_command *command, const cli_arguments *arguments) {
  if (cli_value(command, arguments, "wait") == NULL) {
    return ask_and_print(command, arguments, scope_params(command, arguments), -1, print_state);
  }
  clt_error error = {0};
  json_t *last = NULL;
  clt_status status = reacquire_and_wait(command, arguments, &last, &error);
  json_decref(last);
  return status == CLT_OK ? CLI_DONE : cli_fail(command, &error);
}

static const cli_option reacquire_options[] = {
    {"socket", 's', "PATH", "the daemon's control socket (else $COUNTERLIGHT_SOCKET, else the usual one)"},
    {"scope", 0, "WHAT", "transport (the default), photometry, geometry or changed"},
    {"wait", 'w', NULL, "print what happens until the new transport is in use; fail if it failed"},
    {NULL, 0, NULL, NULL},
};

static const cli_option watch_options[] = {
    {"socket", 's', "PATH", "the daemon's control socket (else $COUNTERLIGHT_SOCKET, else the usual one)"},
    {"until", 'u', "STATE", "end when the daemon is in this state (also if it is so already)"},
    {NULL, 0, NULL, NULL},
};

const cli_command cli_command_status = {.name = "status",
                                        .synopsis = "[--socket PATH]",
                                        .summary = "say what the running daemon does and how well",
                                        .options = socket_only,
                                        .run = run_status};
const cli_command cli_command_reacquire = {.name = "reacquire",
                                           .synopsis = "[--scope WHAT] [--wait] [--socket PATH]",
                                           .summary = "have the running daemon measure the light transport again",
                                           .options = reacquire_options,
                                           .run = run_reacquire};
const cli_command cli_command_show = {.name = "show",
                                      .synopsis = "PIC [--socket PATH]",
                                      .summary = "have the running daemon show another picture",
                                      .options = socket_only,
                                      .positional_least = 1,
                                      .positional_most = 1,
                                      .run = run_show};
const cli_command cli_command_watch = {.name = "watch",
                                       .synopsis = "[--until STATE] [--socket PATH]",
                                       .summary = "print the running daemon's states and progress, one a line",
                                       .options = watch_options,
                                       .run = run_watch};
const cli_command cli_command_snapshot = {.name = "snapshot",
                                          .synopsis = "[--socket PATH]",
                                          .summary = "have the running daemon write target, drive and photograph",
                                          .options = socket_only,
                                          .run = run_snapshot};
const cli_command cli_command_hold = {.name = "hold",
                                      .synopsis = "[--socket PATH]",
                                      .summary = "have the running daemon leave the picture as it is",
                                      .options = socket_only,
                                      .run = run_state};
const cli_command cli_command_refine = {.name = "refine",
                                        .synopsis = "[--socket PATH]",
                                        .summary = "have the running daemon correct its picture by photographs of it",
                                        .options = socket_only,
                                        .run = run_state};
const cli_command cli_command_resume = {.name = "resume",
                                        .synopsis = "[--socket PATH]",
                                        .summary = "have the running daemon go on after hold",
                                        .options = socket_only,
                                        .run = run_state};
const cli_command cli_command_reload = {.name = "reload",
                                        .synopsis = "[--socket PATH]",
                                        .summary = "have the running daemon read its configuration again",
                                        .options = socket_only,
                                        .run = run_reload};
