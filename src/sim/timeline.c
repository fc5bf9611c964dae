#include "sim/timeline.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static clt_lighting *take_spare(clt_timeline *timeline) {
  clt_lighting *lighting = timeline->spare;
  if (lighting != NULL) {
    timeline->spare = lighting->next;
    return lighting;
  }
  lighting = clt_alloc(1, sizeof *lighting);
  float *values = clt_alloc((size_t)(1 + timeline->layers) * timeline->values, sizeof *values);
  if (lighting == NULL || values == NULL) {
    free(lighting);
    free(values);
    return NULL;
  }
  lighting->drive = values;
  lighting->radiance = values + timeline->values;
  return lighting;
}

static void free_list(clt_lighting *lighting) {
  while (lighting != NULL) {
    clt_lighting *next = lighting->next;
    free(lighting->drive);
    free(lighting);
    lighting = next;
  }
}

clt_status clt_timeline_init(clt_timeline *timeline, clt_error *error) {
  timeline->first = timeline->last = take_spare(timeline);
  if (timeline->first == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the projector's first pattern");
  }
  timeline->first->lit_ns = INT64_MIN;
  return CLT_OK;
}

void clt_timeline_finish(clt_timeline *timeline) {
  free_list(timeline->first);
  free_list(timeline->spare);
  *timeline = (clt_timeline){0};
}

clt_status clt_timeline_show(clt_timeline *timeline, const float *drive, int64_t lit_ns, clt_error *error) {
  size_t bytes = timeline->values * sizeof *drive;
  if (memcmp(timeline->last->drive, drive, bytes) == 0) {
    return CLT_OK;
  }
  clt_lighting *lighting = take_spare(timeline);
  if (lighting == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the projector's next pattern");
  }
  memcpy(lighting->drive, drive, bytes);
  lighting->lit_ns = lit_ns;
  lighting->computed = false;
  lighting->next = NULL;
  timeline->last->next = lighting;
  timeline->last = lighting;
  return CLT_OK;
}

void clt_timeline_forget(clt_timeline *timeline, int64_t before_ns) {
  while (timeline->first->next != NULL && timeline->first->next->lit_ns <= before_ns) {
    clt_lighting *gone = timeline->first;
    timeline->first = gone->next;
    gone->next = timeline->spare;
    timeline->spare = gone;
  }
}

/* The band gains share of what a pattern lights. */
static void add_share(const clt_lighting *lighting, float share, const clt_band *band, clt_exposure *exposure) {
  size_t width = (size_t)exposure->width, height = (size_t)exposure->height,
         cell_rows = height / (size_t)exposure->split;
  for (size_t c = 0; c < (size_t)exposure->channels; c++) {
    for (size_t y = (size_t)band->first; y < (size_t)band->last; y++) {
      const float *from = &lighting->radiance[(c * cell_rows + y / (size_t)exposure->split) * width];
      float *to = &exposure->radiance[(c * height + y) * width];
      for (size_t x = 0; x < width; x++) {
        to[x] += share * from[x];
      }
    }
  }
}

void clt_timeline_expose(clt_timeline *timeline, const clt_band *band, clt_exposure *exposure) {
  size_t width = (size_t)exposure->width, rows = (size_t)(band->last - band->first);
  for (int c = 0; c < exposure->channels; c++) {
    size_t first = ((size_t)c * (size_t)exposure->height + (size_t)band->first) * width;
    memset(&exposure->radiance[first], 0, rows * width * sizeof *exposure->radiance);
  }
  for (clt_lighting *lighting = timeline->first; lighting != NULL; lighting = lighting->next) {
    int64_t from = lighting->lit_ns > band->start_ns ? lighting->lit_ns : band->start_ns;
    int64_t to =
        lighting->next != NULL && lighting->next->lit_ns < band->end_ns ? lighting->next->lit_ns : band->end_ns;
    if (to <= from) {
      continue;
    }
    if (!lighting->computed) {
      timeline->light(timeline->context, lighting->drive, lighting->radiance);
      lighting->computed = true;
    }
    add_share(lighting, (float)((double)(to - from) / (double)(band->end_ns - band->start_ns)), band, exposure);
  }
}
