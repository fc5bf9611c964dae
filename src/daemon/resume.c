#include "daemon/resume.h"

#include <inttypes.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

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
    struct stat file = {0};
    if (files[k][0] != '\0' && used >= 0 && (size_t)used < size && stat(files[k], &file) == 0) {
      used += snprintf(text + used, size - (size_t)used, "; %zu: %" PRIdMAX ".%09ld, %" PRIdMAX, k,
                       (intmax_t)file.st_mtim.tv_sec, file.st_mtim.tv_nsec, (intmax_t)file.st_size);
    }
  }
}
