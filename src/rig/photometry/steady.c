#include "rig/photometry/steady.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* Bands of one picture differ by no more than this share of their light, and this share of full scale: flicker, noise
 * and a gain that moves stay below. */
#define SHARE 0.1
#define OFFSET 0.01
/* Rounds of three, and frames in a row, after which there is no hope. */
enum { ROUNDS = 6 };

static size_t samples_of(const clt_shots *shots) {
  const clt_camera_info *sensor = &shots->sensor;
  return (size_t)sensor->width * (size_t)sensor->height * (size_t)sensor->channels;
}

clt_status clt_steady_init(clt_steady *steady, clt_shots *shots, clt_error *error) {
  *steady = (clt_steady){.shots = shots, .held = clt_alloc(CLT_STEADY_HELD * samples_of(shots), sizeof *steady->held)};
  return steady->held != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "out of memory for frames of %zu samples", samples_of(shots));
}

void clt_steady_finish(clt_steady *steady) {
  free(steady->held);
  *steady = (clt_steady){0};
}

static void find_bands(const clt_frame *frame, double bands[CLT_STEADY_BANDS]) {
  for (int b = 0; b < CLT_STEADY_BANDS; b++) {
    size_t row = (size_t)frame->width * (size_t)frame->channels;
    size_t first = row * (size_t)(b * frame->height / CLT_STEADY_BANDS);
    size_t end = row * (size_t)((b + 1) * frame->height / CLT_STEADY_BANDS);
    double sum = 0;
    for (size_t k = first; k < end; k++) {
      sum += frame->samples[k];
    }
    bands[b] = end > first ? sum / (double)(end - first) : 0;
  }
}

static bool agree(const clt_shots *shots, const double *a, const double *b) {
  double black = shots->sensor.black_level, full = (1 << shots->sensor.bits) - 1 - black;
  for (int k = 0; k < CLT_STEADY_BANDS; k++) {
    if (fabs(a[k] - b[k]) > SHARE * (fmax(a[k], b[k]) - black) + OFFSET * full) {
      return false;
    }
  }
  return true;
}

/* Takes three frames into the held ones. */
static clt_status hold(clt_steady *steady, double bands[CLT_STEADY_HELD][CLT_STEADY_BANDS], clt_error *error) {
  size_t samples = samples_of(steady->shots);
  for (int k = 0; k < CLT_STEADY_HELD; k++) {
    clt_frame *frame = &steady->frame[k];
    clt_status status = clt_shots_take(steady->shots, steady->ready_ns, steady->seconds, frame, error);
    if (status != CLT_OK) {
      return status;
    }
    uint16_t *copy = steady->held + (size_t)k * samples;
    memcpy(copy, frame->samples, samples * sizeof *copy);
    frame->samples = copy;
    find_bands(frame, bands[k]);
    steady->ready_ns = frame->exposed_ns + 1;
  }
  return CLT_OK;
}

static clt_status give_up(const clt_steady *steady, clt_error *error) {
  return clt_fail(
      error, CLT_FAILED,
      "successive frames of one steady picture at %.4g ms differ by more than a tenth (%ld frames used, %ld "
      "refused so far); check the camera's connection, and that nothing moves",
      steady->seconds * 1e3, steady->shots->frames, steady->shots->retaken);
}

clt_status clt_steady_begin(clt_steady *steady, int64_t ready_ns, double seconds, clt_error *error) {
  steady->ready_ns = ready_ns;
  steady->seconds = seconds;
  for (int round = 0; round < ROUNDS; round++) {
    double bands[CLT_STEADY_HELD][CLT_STEADY_BANDS];
    clt_status status = hold(steady, bands, error);
    if (status != CLT_OK) {
      return status;
    }
    for (int k = 0; k < CLT_STEADY_HELD; k++) {
      steady->count = steady->given = 0;
      for (int other = 0; other < CLT_STEADY_HELD; other++) {
        if (agree(steady->shots, bands[k], bands[other])) {
          steady->left[steady->count++] = other;
        }
      }
      if (2 * steady->count > CLT_STEADY_HELD) {
        memcpy(steady->reference, bands[k], sizeof steady->reference);
        steady->shots->retaken += CLT_STEADY_HELD - steady->count;
        return CLT_OK;
      }
    }
    steady->shots->retaken += CLT_STEADY_HELD;
  }
  return give_up(steady, error);
}

clt_status clt_steady_next(clt_steady *steady, clt_frame *frame, clt_error *error) {
  if (steady->given < steady->count) {
    *frame = steady->frame[steady->left[steady->given++]];
    return CLT_OK;
  }
  for (int round = 0; round < ROUNDS; round++) {
    double bands[CLT_STEADY_BANDS];
    clt_status status = clt_shots_take(steady->shots, steady->ready_ns, steady->seconds, frame, error);
    if (status != CLT_OK) {
      return status;
    }
    find_bands(frame, bands);
    steady->ready_ns = frame->exposed_ns + 1;
    if (agree(steady->shots, bands, steady->reference)) {
      return CLT_OK;
    }
    steady->shots->retaken++;
    steady->shots->frames--;
  }
  return give_up(steady, error);
}
