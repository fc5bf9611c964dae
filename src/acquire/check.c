/* How well a transport predicts what is observed. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "acquire/session.h"
#include "base/memory.h"

/* By a hash of each value's number; zeros and ones, so that no panel rounds it. */
void clt_session_draw(clt_session *session, unsigned number) {
  size_t values = clt_image_size(&session->drive);
  uint64_t state = ((uint64_t)session->options.seed << 32) + number;
  for (size_t i = 0; i < values; i++) {
    /* splitmix64: Steele, Lea, Flood 2014 */
    uint64_t z = (state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    session->drive.data[i] = (float)(z >> 63);
  }
}

/* The drive as the panel showed it: one whose channels mix has no code for every colour. shown is initialised here. */
static clt_status find_shown(const clt_session *session, clt_image *shown, clt_error *error) {
  const clt_image *drive = &session->drive;
  if (session->info.panel != NULL) {
    return clt_panel_shown(session->info.panel, session->info.panel_bits, drive, shown, error);
  }
  clt_status status = clt_image_init(shown, drive->channels, drive->height, drive->width, error);
  if (status == CLT_OK) {
    memcpy(shown->data, drive->data, clt_image_size(drive) * sizeof *drive->data);
  }
  return status;
}

/* ||b0 + T x - y||^2, less what the noise of y adds to it, and ||y||^2. */
typedef struct miss {
  double wrong, seen;
} miss;

/* Adds the last observation's; x and y are workspace of `cells` values each. */
static clt_status add_miss(const clt_session *session, const clt_transport *transport, double *x, double *y, miss *sum,
                           clt_error *error) {
  size_t cells = session->cells;
  clt_image shown = {0};
  clt_status status = find_shown(session, &shown, error);
  for (int c = 0; status == CLT_OK && c < session->info.channels; c++) {
    size_t first = (size_t)c * cells;
    for (size_t j = 0; j < cells; j++) {
      x[j] = shown.data[first + j];
    }
    clt_transport_apply(transport, c, x, y);
    for (size_t i = 0; i < cells; i++) {
      double deviation = session->deviation.data[first + i];
      if (isfinite(deviation)) {
        double observed = session->seen.data[first + i], predicted = y[i] + session->black.data[first + i];
        sum->wrong += (predicted - observed) * (predicted - observed) - deviation * deviation;
        sum->seen += observed * observed;
      }
    }
  }
  clt_image_finish(&shown);
  return status;
}

static double *make_workspace(const clt_session *session, clt_error *error) {
  double *x = clt_alloc(2 * session->cells, sizeof *x);
  if (x == NULL) {
    clt_fail(error, CLT_FAILED, "out of memory for check patterns of %zu cells", session->cells);
  }
  return x;
}

static double relative_miss(const miss *sum) {
  return sum->seen > 0 ? sqrt(fmax(sum->wrong, 0) / sum->seen) : -1;
}

clt_status clt_session_miss(const clt_session *session, const clt_transport *transport, double *relative,
                            clt_error *error) {
  double *x = make_workspace(session, error);
  if (x == NULL) {
    return CLT_FAILED;
  }
  miss sum = {0};
  clt_status status = add_miss(session, transport, x, x + session->cells, &sum, error);
  free(x);
  *relative = relative_miss(&sum);
  return status;
}

clt_status clt_session_check(clt_session *session, const clt_transport *transport, double *relative, clt_error *error) {
  miss sum = {0};
  double *x = make_workspace(session, error);
  clt_status status = x != NULL ? CLT_OK : CLT_FAILED;
  for (int k = 0; status == CLT_OK && k < session->options.checks; k++) {
    clt_session_draw(session, (unsigned)k);
    status = clt_session_observe(session, "check", error);
    if (status == CLT_OK) {
      status = add_miss(session, transport, x, x + session->cells, &sum, error);
    }
  }
  free(x);
  *relative = relative_miss(&sum);
  return status;
}
