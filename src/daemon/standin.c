#include "daemon/standin.h"

#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/memory.h"

/* Longer than any refresh, shorter than anybody's patience, s. */
static const double answer_timeout_s = 5;

typedef struct standin {
  clt_projector base;
  const daemon_boxes *boxes;
  clt_projector_info info;
} standin;

static void describe(const clt_projector *projector, clt_projector_info *info) {
  *info = ((const standin *)projector)->info;
}

static clt_status hand_over(const standin *self, const float *codes, clt_error *error) {
  size_t count = (size_t)self->info.channels * self->info.height * self->info.width;
  output_pattern *pattern = clt_alloc(1, sizeof *pattern);
  float *copy = clt_alloc(count, sizeof *copy);
  if (pattern == NULL || copy == NULL) {
    free(pattern);
    free(copy);
    return clt_fail(error, CLT_FAILED, "a pattern for the projector: out of memory");
  }
  memcpy(copy, codes, count * sizeof *copy);
  pattern->codes = copy;
  free(clt_mailbox_take(self->boxes->answers, 0)); /* to a pattern that was given up */
  clt_mailbox_put(self->boxes->patterns, pattern);
  return CLT_OK;
}

static clt_status present(clt_projector *projector, const float *codes, int64_t *shown_ns, clt_error *error) {
  const standin *self = (const standin *)projector;
  clt_status status = hand_over(self, codes, error);
  if (status != CLT_OK) {
    return status;
  }
  int64_t start_ns = clt_clock_ns();
  output_answer *answer = clt_mailbox_take(self->boxes->answers, answer_timeout_s);
  if (answer == NULL) {
    bool late = clt_clock_since(start_ns) >= answer_timeout_s;
    return late ? clt_fail(error, CLT_TIMEOUT, "the output did not show a pattern within %g s", answer_timeout_s)
                : clt_fail(error, CLT_CANCELLED, "the daemon is stopping");
  }
  *shown_ns = answer->shown_ns;
  status = answer->error.status;
  if (status != CLT_OK && error != NULL) {
    *error = answer->error;
  }
  free(answer);
  return status;
}

static void close_standin(clt_projector *projector) {
  free(projector);
}

clt_status standin_create(const daemon_boxes *boxes, const clt_projector_info *info, clt_projector **out,
                          clt_error *error) {
  static const clt_projector_driver driver = {
      .name = "stand-in", .describe = describe, .present = present, .close = close_standin};
  standin *made = clt_alloc(1, sizeof *made);
  if (made == NULL) {
    return clt_fail(error, CLT_FAILED, "the stand-in projector: out of memory");
  }
  *made = (standin){{&driver}, boxes, *info};
  *out = &made->base;
  return CLT_OK;
}

void standin_release(const daemon_boxes *boxes) {
  output_pattern *nothing = clt_alloc(1, sizeof *nothing);
  if (nothing != NULL) {
    clt_mailbox_put(boxes->patterns, nothing);
  }
}
