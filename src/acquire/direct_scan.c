/* Every fourth cell in both directions is lit at a time, so that each observed cell has one lit cell at each of the
 * offsets -2..1 by -2..1 in one of 16 photographs. In those of the nine offsets within one cell it sees direct light
 * (and what defocus and footprints spill) on top of what the others see too: light from everywhere, a sixteenth of the
 * flood's, which is subtracted (the idea of Nayar, Krishnan, Grossberg, Raskar 2006: high frequencies separate). */
#include "acquire/direct_scan.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

#define KEPT_SIGMAS 3.0
enum { REACH = 1 };

/* The photographs: light less black and its variance, [pattern][channel][cell]. */
typedef struct scan {
  int width, height, channels;
  size_t cells;
  float *light, *variance;
} scan;

static void light_grid(clt_session *session, int pattern) {
  clt_image *drive = &session->drive;
  clt_session_fill(session, 0);
  for (int line = 0; line < drive->channels * drive->height; line++) {
    if (line % drive->height % CLT_SCAN_PITCH == pattern / CLT_SCAN_PITCH) {
      for (int x = pattern % CLT_SCAN_PITCH; x < drive->width; x += CLT_SCAN_PITCH) {
        drive->data[(size_t)line * (size_t)drive->width + (size_t)x] = 1;
      }
    }
  }
}

static clt_status photograph(clt_session *session, scan *all, clt_error *error) {
  const size_t values = (size_t)all->channels * all->cells;
  for (int pattern = 0; pattern < CLT_SCAN_PATTERNS; pattern++) {
    light_grid(session, pattern);
    clt_status status = clt_session_observe(session, "direct light", error);
    if (status != CLT_OK) {
      return status;
    }
    for (size_t at = 0; at < values; at++) {
      const float deviation = session->deviation.data[at];
      all->light[(size_t)pattern * values + at] = session->seen.data[at] - session->black.data[at];
      all->variance[(size_t)pattern * values + at] = deviation * deviation + session->black_variance.data[at];
    }
  }
  return CLT_OK;
}

/* The lit cell of a pattern that stands at an offset of -2..1 from cell i, if it is near; else -1. */
static int32_t near_cell(const scan *all, int pattern, size_t i) {
  const int x = (int)(i % (size_t)all->width), y = (int)(i / (size_t)all->width);
  int dx = (pattern % CLT_SCAN_PITCH - x % CLT_SCAN_PITCH + CLT_SCAN_PITCH) % CLT_SCAN_PITCH;
  int dy = (pattern / CLT_SCAN_PITCH - y % CLT_SCAN_PITCH + CLT_SCAN_PITCH) % CLT_SCAN_PITCH;
  dx -= dx > REACH ? CLT_SCAN_PITCH : 0;
  dy -= dy > REACH ? CLT_SCAN_PITCH : 0;
  const bool near =
      dx >= -REACH && dy >= -REACH && x + dx >= 0 && x + dx < all->width && y + dy >= 0 && y + dy < all->height;
  return near ? (y + dy) * all->width + x + dx : -1;
}

/* What one observed cell tells: its near entries, one for each pattern that lights a near cell. */
typedef struct row {
  int32_t cell[CLT_SCAN_PATTERNS];
  float value[CLT_CHANNELS_MAX][CLT_SCAN_PATTERNS], variance[CLT_CHANNELS_MAX][CLT_SCAN_PATTERNS];
} row;

/* Subtracts the mean of the photographs without a near lit cell. One in which cell i was not seen tells nothing. */
static void read_row(const scan *all, size_t i, row *found) {
  for (int pattern = 0; pattern < CLT_SCAN_PATTERNS; pattern++) {
    found->cell[pattern] = near_cell(all, pattern, i);
  }
  for (int c = 0; c < all->channels; c++) {
    double sum = 0, variance = 0, count = 0;
    for (int pattern = 0; pattern < CLT_SCAN_PATTERNS; pattern++) {
      const size_t at = ((size_t)pattern * (size_t)all->channels + (size_t)c) * all->cells + i;
      found->value[c][pattern] = all->light[at];
      found->variance[c][pattern] = all->variance[at];
      if (found->cell[pattern] < 0 && isfinite(all->variance[at])) {
        sum += (double)all->light[at];
        variance += (double)all->variance[at];
        count += 1;
      }
    }
    for (int pattern = 0; count > 0 && pattern < CLT_SCAN_PATTERNS; pattern++) {
      found->value[c][pattern] -= (float)(sum / count);
      found->variance[c][pattern] += (float)(variance / (count * count));
    }
  }
}

static bool is_kept(const scan *all, const row *found, int pattern, size_t i) {
  bool kept = found->cell[pattern] == (int32_t)i;
  for (int c = 0; c < all->channels && found->cell[pattern] >= 0; c++) {
    const double value = (double)found->value[c][pattern], variance = (double)found->variance[c][pattern];
    kept = kept || (isfinite(variance) && value * value > KEPT_SIGMAS * KEPT_SIGMAS * variance);
  }
  return kept;
}

static void count_entries(const scan *all, clt_near *near) {
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < all->cells; i++) {
    row found;
    read_row(all, i, &found);
    for (int pattern = 0; pattern < CLT_SCAN_PATTERNS; pattern++) {
      near->start[i + 1] += is_kept(all, &found, pattern, i);
    }
  }
  for (size_t i = 0; i < all->cells; i++) {
    near->start[i + 1] += near->start[i];
  }
}

static void write_entries(const scan *all, clt_near *near) {
  const int64_t entries = near->start[all->cells];
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < all->cells; i++) {
    row found;
    read_row(all, i, &found);
    int64_t e = near->start[i];
    for (int pattern = 0; pattern < CLT_SCAN_PATTERNS; pattern++) {
      if (!is_kept(all, &found, pattern, i)) {
        continue;
      }
      for (int c = 0; c < all->channels; c++) {
        const bool seen = isfinite(found.variance[c][pattern]);
        near->value[c * entries + e] = seen ? found.value[c][pattern] : 0;
        near->variance[(size_t)c * all->cells + i] += found.variance[c][pattern];
      }
      near->cell[e++] = found.cell[pattern];
    }
  }
}

static clt_status keep_entries(const scan *all, clt_near *near, clt_error *error) {
  count_entries(all, near);
  const size_t entries = (size_t)near->start[all->cells];
  near->cell = clt_alloc(entries, sizeof *near->cell);
  near->value = clt_alloc(entries, (size_t)all->channels * sizeof *near->value);
  if (near->cell == NULL || near->value == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the direct light of %zu cells", all->cells);
  }
  write_entries(all, near);
  return CLT_OK;
}

clt_status clt_scan_direct(clt_session *session, clt_near *near, clt_error *error) {
  const clt_rig_info *info = &session->info;
  const size_t values = (size_t)info->channels * session->cells;
  scan all = {info->width,
              info->height,
              info->channels,
              session->cells,
              clt_alloc(values, CLT_SCAN_PATTERNS * sizeof(float)),
              clt_alloc(values, CLT_SCAN_PATTERNS * sizeof(float))};
  *near = (clt_near){.start = clt_alloc(session->cells + 1, sizeof *near->start),
                     .variance = clt_alloc(values, sizeof *near->variance)};
  clt_status status = CLT_OK;
  if (all.light == NULL || all.variance == NULL || near->start == NULL || near->variance == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for a scan of %zu cells", session->cells);
  }
  if (status == CLT_OK) {
    status = photograph(session, &all, error);
  }
  if (status == CLT_OK) {
    status = keep_entries(&all, near, error);
  }
  free(all.light);
  free(all.variance);
  return status;
}

void clt_near_finish(clt_near *near) {
  free(near->start);
  free(near->cell);
  free(near->value);
  free(near->variance);
}

void clt_near_light(const clt_near *near, size_t cells, int channel, const int32_t *label, int32_t lit, float *light) {
  const float *value = near->value + channel * near->start[cells];
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < cells; i++) {
    float sum = 0;
    for (int64_t e = near->start[i]; e < near->start[i + 1]; e++) {
      sum += label[near->cell[e]] == lit ? value[e] : 0;
    }
    light[i] = sum;
  }
}
