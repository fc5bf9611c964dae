#include "daemon/resume.h"

#include <stdio.h>
#include <unistd.h>

#include "base/file.h"

static void drop(const measure_job *job) {
  if (job->journal[0] != '\0') {
    unlink(job->journal);
  }
}

void resume_begin(const measure_job *job) {
  const bool acquires = job->kind == MEASURE_ACQUIRE || job->kind == MEASURE_PHOTOMETRY ||
                        job->kind == MEASURE_CHANGED || job->kind == MEASURE_GEOMETRY;
  if (acquires && job->anew) {
    drop(job);
  }
}

void resume_settle(const measure_job *job, clt_status status) {
  if (status != CLT_OK && status != CLT_GONE && status != CLT_TIMEOUT && status != CLT_CANCELLED) {
    drop(job);
  }
}

void resume_describe(const measure_job *job, const clt_station *station, char *text, size_t size) {
  const char *const files[] = {job->settings, job->config.scene, job->config.calibration, job->calibration};
  int used = snprintf(text, size, "%s; calibrated %d", job->config.scheme, station->calibration != NULL);
  for (size_t k = 0; k < sizeof files / sizeof files[0]; k++) {
    char stamp[CLT_STAMP_MAX];
    clt_file_stamp(files[k], stamp);
    if (stamp[0] != '\0' && used >= 0 && (size_t)used < size) {
      used += snprintf(text + used, size - (size_t)used, "; %zu: %s", k, stamp);
    }
  }
}
