/* The server on a real socket, with the loop turned by hand. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "daemon/listen.h"
#include "daemon/server.h"
#include "support.h"

enum { DEFERRED = 3 };

typedef struct bench {
  char folder[64], path[96];
  listener listening;
  sd_event *loop;
  server *service;
  int requests;
  int passed; /* the last descriptor that came along */
} bench;

/* "echo" replies with its params, "later" defers, "news" notifies everybody from within a request, "many" answers with
 * a hundred thousand characters. */
static void answer(void *context, client *from, const rpc_request *request) {
  bench *self = context;
  self->requests++;
  if (strcmp(request->method, "echo") == 0) {
    self->passed = client_take_passed(from);
    server_reply(from, request, request->params != NULL ? json_incref(request->params) : json_null());
  } else if (strcmp(request->method, "later") == 0) {
    server_defer(from, request, DEFERRED, 5);
  } else if (strcmp(request->method, "subscribe") == 0) {
    from->subscribed = true;
    server_reply(from, request, json_true());
  } else if (strcmp(request->method, "news") == 0) {
    server_notify(self->service, "state", json_string("x"));
    server_reply(from, request, json_true());
  } else if (strcmp(request->method, "many") == 0) {
    char *text = malloc(100001);
    memset(text, 'm', 100000);
    text[100000] = '\0';
    server_reply(from, request, json_string(text));
    free(text);
  } else {
    server_refuse(from, request, RPC_UNKNOWN_METHOD, "what?");
  }
}

static int set_up(void **state) {
  bench *self = calloc(1, sizeof *self);
  clt_error error = {0};
  test_folder(self->folder);
  snprintf(self->path, sizeof self->path, "%s/control.sock", self->folder);
  assert_ok(listener_open(self->path, NULL, &self->listening, &error), error);
  assert_true(sd_event_new(&self->loop) >= 0);
  assert_ok(server_create(self->loop, self->listening.descriptor, (gid_t)-1, answer, self, &self->service, &error),
            error);
  *state = self;
  return 0;
}

static int tear_down(void **state) {
  bench *self = *state;
  server_destroy(self->service);
  sd_event_unref(self->loop);
  listener_close(&self->listening);
  assert_int_not_equal(access(self->path, F_OK), 0);
  rmdir(self->folder);
  free(self);
  return 0;
}

/* Lets the server do what it can do now. */
static void turn(bench *self) {
  while (sd_event_run(self->loop, 0) > 0) {
  }
}

static int connect_client(const bench *self) {
  struct sockaddr_un address = {.sun_family = AF_UNIX};
  strcpy(address.sun_path, self->path);
  int descriptor = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
  assert_int_equal(connect(descriptor, (struct sockaddr *)&address, sizeof address), 0);
  return descriptor;
}

static void say(bench *self, int descriptor, const char *text) {
  assert_int_equal(write(descriptor, text, strlen(text)), (ssize_t)strlen(text));
  turn(self);
}

/* What has come, as one text; "closed" is added at the end of the stream. */
static const char *hear(int descriptor) {
  static char text[1 << 18];
  size_t used = 0;
  ssize_t count;
  while ((count = read(descriptor, text + used, sizeof text - 16 - used)) > 0) {
    used += (size_t)count;
  }
  text[used] = '\0';
  return count == 0 || errno == ECONNRESET ? strcat(text, "closed") : text;
}

#define CALL(method) "{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"" method "\"}\n"

static void lines_are_answered_in_order_whole_or_in_pieces(void **state) {
  bench *self = *state;
  int one = connect_client(self);
  say(self, one, "{\"jsonrpc\":\"2.0\",\"id\":1,\"meth");
  assert_string_equal(hear(one), "");
  say(self, one,
      "od\":\"echo\",\"params\":{\"a\":1}}\n{\"id\":2}\nx\n{\"jsonrpc\":\"2.0\",\"id\":3,\"method\":\"foo\"}\n");
  const char *heard = hear(one);
  const char *first = strstr(heard, "\"result\":{\"a\":1}"), *second = strstr(heard, "-32600"),
             *third = strstr(heard, "-32700"), *fourth = strstr(heard, "-32601");
  assert_true(first != NULL && second > first && third > second && fourth > third);
  say(self, one, "{\"jsonrpc\":\"2.0\",\"method\":\"echo\"}\n"); /* a notification has no reply */
  assert_string_equal(hear(one), "");
  assert_int_equal(self->requests, 3);
  close(one);
  turn(self);
}

static void an_oversized_line_is_answered_and_ends_the_connection(void **state) {
  bench *self = *state;
  int one = connect_client(self), other = connect_client(self);
  char block[4097];
  memset(block, 'x', 4096);
  block[4096] = '\0';
  for (int i = 0; i < 17; i++) {
    if (write(one, block, 4096) < 0) {
      break;
    }
    turn(self);
  }
  const char *heard = hear(one);
  assert_non_null(strstr(heard, "-32600"));
  assert_non_null(strstr(heard, "closed"));
  say(self, other, CALL("echo"));
  assert_non_null(strstr(hear(other), "result"));
  close(one);
  close(other);
}

static void a_client_that_never_reads_is_dropped_and_delays_nobody(void **state) {
  bench *self = *state;
  int deaf = connect_client(self), other = connect_client(self);
  for (int i = 0; i < 40; i++) {
    if (write(deaf, CALL("many"), strlen(CALL("many"))) < 0) {
      break;
    }
    turn(self);
    say(self, other, CALL("echo"));
    assert_non_null(strstr(hear(other), "result"));
  }
  assert_true(self->requests - 40 <= 16); /* one mebibyte and the socket's own buffer hold no more */
  assert_non_null(strstr(hear(deaf), "closed"));
  close(deaf);
  close(other);
}

static void deferred_replies_come_later_and_hold_back_what_follows(void **state) {
  bench *self = *state;
  clt_error error = {0};
  int one = connect_client(self), other = connect_client(self), leaving = connect_client(self);
  say(self, one, CALL("later") CALL("echo"));
  say(self, other, CALL("later"));
  say(self, leaving, CALL("later"));
  close(leaving);
  turn(self);
  assert_string_equal(hear(one), "");
  json_t *result = json_string("done");
  server_complete(self->service, DEFERRED, 4, result, &error);
  turn(self);
  assert_string_equal(hear(one), "");
  server_complete(self->service, DEFERRED, 5, result, &error);
  json_decref(result);
  turn(self);
  assert_string_equal(hear(one), "{\"jsonrpc\":\"2.0\",\"id\":1,\"result\":\"done\"}\n"
                                 "{\"jsonrpc\":\"2.0\",\"id\":1,\"result\":null}\n");
  assert_string_equal(hear(other), "{\"jsonrpc\":\"2.0\",\"id\":1,\"result\":\"done\"}\n");
  close(one);
  close(other);
}

static void subscribers_hear_every_state_and_the_latest_progress(void **state) {
  bench *self = *state;
  int one = connect_client(self), other = connect_client(self);
  say(self, one, CALL("subscribe"));
  hear(one);
  say(self, one, CALL("news"));
  assert_string_equal(hear(one), "{\"jsonrpc\":\"2.0\",\"method\":\"state\",\"params\":\"x\"}\n"
                                 "{\"jsonrpc\":\"2.0\",\"id\":1,\"result\":true}\n");
  assert_string_equal(hear(other), "");
  /* While the socket is full, progress piles up to one letter: the latest. */
  char padding[2001];
  memset(padding, 'p', 2000);
  padding[2000] = '\0';
  for (int i = 0; i <= 5000; i++) {
    server_notify_latest(self->service, "progress", json_pack("{s:i, s:s}", "done", i, "padding", padding));
  }
  static char all[1 << 20];
  all[0] = '\0';
  for (int i = 0; i < 40; i++) {
    strncat(all, hear(one), sizeof all - strlen(all) - 1);
    turn(self);
  }
  assert_non_null(strstr(all, "{\"done\":5000,"));
  int letters = 0, last = -1;
  for (char *at = all; (at = strstr(at, "\"done\":")) != NULL; letters++, at++) {
    int done = atoi(at + 7);
    assert_true(done > last);
    last = done;
  }
  assert_true(letters < 4000);
  close(one);
  close(other);
}

static void a_descriptor_comes_along(void **state) {
  bench *self = *state;
  int one = connect_client(self), file = open("/dev/null", O_RDONLY);
  union {
    struct cmsghdr header;
    char bytes[CMSG_SPACE(2 * sizeof(int))];
  } control = {.bytes = {0}};
  struct iovec part = {(void *)(size_t)CALL("echo"), strlen(CALL("echo"))};
  struct msghdr message = {
      .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
  control.header = (struct cmsghdr){CMSG_LEN(2 * sizeof(int)), SOL_SOCKET, SCM_RIGHTS};
  memcpy(CMSG_DATA(&control.header), &file, sizeof file);
  memcpy(CMSG_DATA(&control.header) + sizeof file, &file, sizeof file);
  assert_true(sendmsg(one, &message, 0) > 0);
  turn(self);
  assert_true(self->passed >= 0);
  assert_true(fcntl(self->passed, F_GETFD) & FD_CLOEXEC);
  close(self->passed);
  say(self, one, CALL("echo"));
  assert_int_equal(self->passed, -1);
  close(file);
  close(one);
}

static void at_most_64_clients_are_served(void **state) {
  bench *self = *state;
  int all[SERVER_CLIENTS_MOST + 1];
  for (int i = 0; i <= SERVER_CLIENTS_MOST; i++) {
    all[i] = connect_client(self);
    turn(self);
  }
  assert_non_null(strstr(hear(all[SERVER_CLIENTS_MOST]), "closed"));
  say(self, all[SERVER_CLIENTS_MOST - 1], CALL("echo"));
  assert_non_null(strstr(hear(all[SERVER_CLIENTS_MOST - 1]), "result"));
  close(all[0]);
  turn(self);
  int again = connect_client(self);
  say(self, again, CALL("echo"));
  assert_non_null(strstr(hear(again), "result"));
  close(again);
  for (int i = 1; i <= SERVER_CLIENTS_MOST; i++) {
    close(all[i]);
  }
  turn(self);
}

static void a_socket_in_use_is_refused_and_a_stale_one_replaced(void **state) {
  bench *self = *state;
  clt_error error = {0};
  listener second;
  assert_int_equal(listener_open(self->path, NULL, &second, &error), CLT_FAILED);
  assert_non_null(strstr(error.message, "another counterlightd"));
  turn(self);
  char stale[112], file[112], longer[200];
  snprintf(stale, sizeof stale, "%s/stale.sock", self->folder);
  assert_ok(listener_open(stale, "no-such-group-here", &second, &error), error);
  close(second.descriptor); /* as a killed daemon leaves it */
  assert_ok(listener_open(stale, NULL, &second, &error), error);
  listener_close(&second);
  snprintf(file, sizeof file, "%s/file", self->folder);
  close(open(file, O_CREAT | O_WRONLY, 0600));
  assert_int_equal(listener_open(file, NULL, &second, &error), CLT_FAILED);
  assert_int_equal(access(file, F_OK), 0);
  unlink(file);
  memset(longer, 'a', sizeof longer - 1);
  longer[sizeof longer - 1] = '\0';
  assert_int_equal(listener_open(longer, NULL, &second, &error), CLT_BAD_INPUT);
}

int main(void) {
  signal(SIGPIPE, SIG_IGN); /* writing to a connection that the server closed is part of the tests */
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_setup_teardown(lines_are_answered_in_order_whole_or_in_pieces, set_up, tear_down),
      cmocka_unit_test_setup_teardown(an_oversized_line_is_answered_and_ends_the_connection, set_up, tear_down),
      cmocka_unit_test_setup_teardown(a_client_that_never_reads_is_dropped_and_delays_nobody, set_up, tear_down),
      cmocka_unit_test_setup_teardown(deferred_replies_come_later_and_hold_back_what_follows, set_up, tear_down),
      cmocka_unit_test_setup_teardown(subscribers_hear_every_state_and_the_latest_progress, set_up, tear_down),
      cmocka_unit_test_setup_teardown(a_descriptor_comes_along, set_up, tear_down),
      cmocka_unit_test_setup_teardown(at_most_64_clients_are_served, set_up, tear_down),
      cmocka_unit_test_setup_teardown(a_socket_in_use_is_refused_and_a_stale_one_replaced, set_up, tear_down),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
