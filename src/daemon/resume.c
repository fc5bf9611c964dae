#include "daemon/resume.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"

static const char starts_ending[] = ".starts";

static void name_starts(const char *journal, char path[CLT_PATH_MAX + sizeof starts_ending]) {
  snprintf(path, CLT_PATH_MAX + sizeof starts_ending, "%s%s", journal, starts_ending);
}

static void remove_file(const char *path) {
  if (unlink(path) != 0 && errno != ENOENT && errno != EROFS) {
    clt_log(CLT_LOG_WARNING, "%s cannot be removed: %s", path, strerror(errno));
  }
}

void resume_drop(const char *journal) {
  char starts[CLT_PATH_MAX + sizeof starts_ending];
  if (journal[0] != '\0') {
    name_starts(journal, starts);
    remove_file(journal);
    remove_file(starts);
  }
}

/* Starts of the daemon that went on with the journal. */
static int count_starts(const char *journal) {
  char path[CLT_PATH_MAX + sizeof starts_ending];
  int count = 0;
  name_starts(journal, path);
  FILE *file = fopen(path, "re");
  if (file != NULL) {
    count = fscanf(file, "%d", &count) == 1 ? count : RESUME_STARTS;
    fclose(file);
  }
  return count;
}

/* An acquisition that ends the daemon must not do so for ever. */
static bool is_given_up(const char *journal) {
  if (count_starts(journal) < RESUME_STARTS) {
    return false;
  }
  clt_log(CLT_LOG_WARNING,
          "an acquisition is given up that %d starts went on with and none finished; the next begins anew",
          RESUME_STARTS);
  resume_drop(journal);
  return true;
}

bool resume_is_owed(const char *journal) {
  struct stat found;
  return journal[0] != '\0' && stat(journal, &found) == 0 &&
         fabs(difftime(time(NULL), found.st_mtime)) <= RESUME_AGE_S && !is_given_up(journal);
}

/* What cannot be counted is not gone on with. */
static void count_start(const char *journal) {
  char path[CLT_PATH_MAX + sizeof starts_ending], text[16];
  clt_error error = {0};
  int count = count_starts(journal) + 1, length = snprintf(text, sizeof text, "%d\n", count);
  name_starts(journal, path);
  if (clt_file_write(path, text, (size_t)length, &error) == CLT_OK) {
    clt_log(CLT_LOG_NOTICE, "an acquisition that was interrupted goes on (start %d of at most %d)", count,
            RESUME_STARTS);
  } else {
    clt_log(CLT_LOG_WARNING, "an acquisition that was interrupted begins anew: %s", error.message);
    resume_drop(journal);
  }
}

void resume_begin(const measure_job *job, bool *first) {
  const bool acquires = job->kind == MEASURE_ACQUIRE || job->kind == MEASURE_PHOTOMETRY ||
                        job->kind == MEASURE_CHANGED || job->kind == MEASURE_GEOMETRY;
  if (!acquires || job->journal[0] == '\0') {
    return;
  }
  if (job->anew || access(job->journal, F_OK) != 0) {
    resume_drop(job->journal);
  } else if (*first && !is_given_up(job->journal)) {
    count_start(job->journal);
  }
  *first = false;
}

void resume_settle(const measure_job *job, clt_status status) {
  if (status != CLT_OK && status != CLT_GONE && status != CLT_TIMEOUT && status != CLT_CANCELLED) {
    resume_drop(job->journal);
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
