/* Status codes and messages: how every function of the library that can fail reports.
 *
 * A function returns a clt_status and takes a clt_error as its last argument. Codes differ only where a caller acts
 * differently; the message says what failed, why, and what to do. Passing NULL for the error drops the message. */
#ifndef COUNTERLIGHT_STATUS_H
#define COUNTERLIGHT_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum clt_status {
  CLT_OK = 0,
  CLT_FAILED = 1,    /* the work could not be done: a file system, a library or an invariant failed */
  CLT_BAD_INPUT = 2, /* what the caller gave is wrong; trying again with the same input cannot help */
  CLT_TIMEOUT = 3,   /* a device did not answer in time; trying again may help */
  CLT_GONE = 4,      /* a device is no longer there; it must be opened again */
  CLT_CANCELLED = 5  /* the caller asked to stop */
} clt_status;

#define CLT_MESSAGE_MAX 512
#define CLT_PATH_MAX 1024 /* room for a path, its terminator included; longer ones are refused */

typedef struct clt_error {
  clt_status status;
  char message[CLT_MESSAGE_MAX]; /* one line, no trailing newline; empty while status is CLT_OK */
} clt_error;

#if defined(__GNUC__)
#define CLT_PRINTF(format_index, first_index) __attribute__((format(printf, format_index, first_index)))
#define CLT_PUBLIC __attribute__((visibility("default")))
#else
#define CLT_PRINTF(format_index, first_index)
#define CLT_PUBLIC
#endif

/* Fills error (which may be NULL) with status and a message, and returns status, so that a failing function ends in
 * `return clt_fail(error, CLT_BAD_INPUT, "...")`. */
CLT_PUBLIC clt_status clt_fail(clt_error *error, clt_status status, const char *format, ...) CLT_PRINTF(3, 4);

/* Puts context before the message that error already holds ("opening the camera: " + message). Returns its status. */
CLT_PUBLIC clt_status clt_fail_within(clt_error *error, const char *format, ...) CLT_PRINTF(2, 3);

/* The status as one lower-case word for logs and JSON: "ok", "failed", "bad-input", "timeout", "gone", "cancelled". */
CLT_PUBLIC const char *clt_status_name(clt_status status);

#ifdef __cplusplus
}
#endif
#endif
