#include "daemon/rpc.h"
#include "support.h"

static rpc_code code_of(const char *line) {
  rpc_request request;
  char message[CLT_MESSAGE_MAX] = "";
  rpc_code code = rpc_parse(line, strlen(line), &request, message, sizeof message);
  assert_int_equal(code != RPC_FINE, message[0] != '\0');
  assert_int_equal(code == RPC_FINE, request.method != NULL);
  rpc_finish(&request);
  return code;
}

static void requests_are_told_from_the_rest(void **state) {
  (void)state;
  static const struct {
    const char *line;
    rpc_code wanted;
  } cases[] = {
      {"{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\"}", RPC_FINE},
      {"{\"jsonrpc\":\"2.0\",\"method\":\"status\"}", RPC_FINE},
      {"{\"jsonrpc\":\"2.0\",\"id\":null,\"method\":\"status\",\"params\":{}}", RPC_FINE},
      {"{\"jsonrpc\":\"2.0\",\"id\":\"a\",\"method\":\"status\",\"params\":[]}", RPC_FINE},
      {"  {\"jsonrpc\":\"2.0\",\"id\":1.5,\"method\":\"\"}  \r", RPC_FINE},
      {"", RPC_PARSE_ERROR},
      {"{", RPC_PARSE_ERROR},
      {"status", RPC_PARSE_ERROR},
      {"{\"jsonrpc\":\"2.0\"} {\"jsonrpc\":\"2.0\"}", RPC_PARSE_ERROR},
      {"{\"jsonrpc\":\"2.0\",\"method\":\"a\",\"method\":\"b\"}", RPC_PARSE_ERROR},
      {"{\"jsonrpc\":\"2.0\",\"method\":\"\xff\xfe\"}", RPC_PARSE_ERROR},
      {"[]", RPC_INVALID_REQUEST},
      {"5", RPC_INVALID_REQUEST},
      {"null", RPC_INVALID_REQUEST},
      {"[{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\"}]", RPC_INVALID_REQUEST},
      {"{}", RPC_INVALID_REQUEST},
      {"{\"jsonrpc\":\"1.0\",\"id\":1,\"method\":\"status\"}", RPC_INVALID_REQUEST},
      {"{\"jsonrpc\":2.0,\"id\":1,\"method\":\"status\"}", RPC_INVALID_REQUEST},
      {"{\"jsonrpc\":\"2.0\",\"id\":1}", RPC_INVALID_REQUEST},
      {"{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":5}", RPC_INVALID_REQUEST},
      {"{\"jsonrpc\":\"2.0\",\"id\":{},\"method\":\"status\"}", RPC_INVALID_REQUEST},
      {"{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\",\"params\":[1]}", RPC_INVALID_PARAMS},
      {"{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\",\"params\":\"x\"}", RPC_INVALID_PARAMS},
  };
  for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
    if (code_of(cases[i].line) != cases[i].wanted) {
      fail_msg("%s gave %d", cases[i].line, code_of(cases[i].line));
    }
  }
}

/* The id comes back with the error where it can be read. */
static void ids_are_kept_for_the_reply(void **state) {
  (void)state;
  static const char line[] = "{\"jsonrpc\":\"2.0\",\"id\":\"seven\",\"params\":{}}";
  rpc_request request;
  char message[CLT_MESSAGE_MAX];
  assert_int_equal(rpc_parse(line, strlen(line), &request, message, sizeof message), RPC_INVALID_REQUEST);
  json_t *reply = rpc_error(request.id, RPC_INVALID_REQUEST, message);
  assert_string_equal(json_string_value(json_object_get(reply, "id")), "seven");
  assert_int_equal(json_integer_value(json_object_get(json_object_get(reply, "error"), "code")), -32600);
  json_decref(reply);
  rpc_finish(&request);
  reply = rpc_error(NULL, RPC_PARSE_ERROR, "no \xff UTF-8");
  assert_true(json_is_null(json_object_get(reply, "id")));
  assert_true(json_is_string(json_object_get(json_object_get(reply, "error"), "message")));
  json_decref(reply);
}

static void deep_nesting_is_an_error_and_no_crash(void **state) {
  (void)state;
  char *line = malloc(60001);
  for (const char *opening = "[{\""; *opening != '\0'; opening++) {
    memset(line, *opening, 60000);
    line[60000] = '\0';
    assert_int_equal(code_of(line), RPC_PARSE_ERROR);
  }
  free(line);
}

/* Random bytes, and good requests with random damage, get an answer or an error and never more. */
static void random_lines_are_answered(void **state) {
  (void)state;
  static const char good[] =
      "{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"reacquire\",\"params\":{\"scope\":\"transport\"}}";
  static const char alphabet[] = "{}[]\",:0123456789.eE+-truefalsn \\u\x01\x7f\xc3\xa4";
  uint64_t random = 7;
  for (int i = 0; i < 2000; i++) {
    char line[160];
    size_t length = (size_t)(test_random(&random) * 150);
    for (size_t k = 0; k < length; k++) {
      line[k] = alphabet[(size_t)(test_random(&random) * (sizeof alphabet - 1))];
    }
    if (i % 2 == 0) {
      length = sizeof good - 1;
      memcpy(line, good, length);
      for (int damage = 0; damage < 1 + i % 5; damage++) {
        line[(size_t)(test_random(&random) * (double)length)] = (char)(test_random(&random) * 256);
      }
    }
    rpc_request request;
    char message[CLT_MESSAGE_MAX] = "";
    rpc_code code = rpc_parse(line, length, &request, message, sizeof message);
    json_t *reply = code == RPC_FINE ? rpc_result(request.id, json_true()) : rpc_error(request.id, code, message);
    char *text = json_dumps(reply, JSON_COMPACT);
    assert_non_null(text);
    assert_null(strchr(text, '\n'));
    free(text);
    json_decref(reply);
    rpc_finish(&request);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(requests_are_told_from_the_rest),
      cmocka_unit_test(ids_are_kept_for_the_reply),
      cmocka_unit_test(deep_nesting_is_an_error_and_no_crash),
      cmocka_unit_test(random_lines_are_answered),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
