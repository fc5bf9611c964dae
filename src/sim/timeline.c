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
  float *values = clt_alloc(2 * timeline->values, sizeof *values);
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

clt_status clt_timeline_init(clt_timeline *timeline, clt_appearance *appearance, clt_error *error) {
  timeline->appearance = appearance;
  timeline->values = appearance->cells * (size_t)appearance->channels;
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

void clt_timeline_expose(clt_timeline *timeline, int64_t start_ns, int64_t end_ns, float *radiance) {
  memset(radiance, 0, timeline->values * sizeof *radiance);
  for (clt_lighting *lighting = timeline->first; lighting != NULL; lighting = lighting->next) {
    int64_t from = lighting->lit_ns > start_ns ? lighting->lit_ns : start_ns;
    int64_t to = lighting->next != NULL && lighting->next->lit_ns < end_ns ? lighting->next->lit_ns : end_ns;
    if (to <= from) {
      continue;
    }
    if (!lighting->computed) {
      clt_appearance_of(timeline->appearance, lighting->drive, lighting->radiance);
      lighting->computed = true;
    }
    float share = (float)((double)(to - from) / (double)(end_ns - start_ns));
    for (size_t k = 0; k < timeline->values; k++) {
      radiance[k] += share * lighting->radiance[k];
    }
  }
}
