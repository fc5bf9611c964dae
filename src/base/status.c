#include "counterlight/status.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

clt_status clt_fail(clt_error *error, clt_status status, const char *format, ...) {
  if (error != NULL) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error->message, sizeof error->message, format, arguments);
    va_end(arguments);
    error->status = status;
  }
  return status;
}

clt_status clt_fail_within(clt_error *error, const char *format, ...) {
  if (error == NULL) {
    return CLT_FAILED;
  }
  char inner[CLT_MESSAGE_MAX];
  memcpy(inner, error->message, sizeof inner);
  va_list arguments;
  va_start(arguments, format);
  int used = vsnprintf(error->message, sizeof error->message, format, arguments);
  va_end(arguments);
  if (used >= 0 && (size_t)used < sizeof error->message) {
    snprintf(error->message + used, sizeof error->message - (size_t)used, "%s", inner);
  }
  return error->status;
}

const char *clt_status_name(clt_status status) {
  static const char *const names[] = {"ok", "failed", "bad-input", "timeout", "gone", "cancelled"};
  return (unsigned)status < sizeof names / sizeof names[0] ? names[status] : "failed";
}
