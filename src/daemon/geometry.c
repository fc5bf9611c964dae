#include "daemon/geometry.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"

static const char file_name[] = "calibration.h5";

void geometry_file(const char *state, char path[CLT_PATH_MAX]) {
  if (clt_file_join(state, file_name, path, NULL) != CLT_OK) {
    path[0] = '\0';
  }
}

void geometry_choose(const char *state, clt_station_config *station) {
  char path[CLT_PATH_MAX];
  int64_t kept = 0, configured = 0;
  clt_error problem = {0};
  geometry_file(state, path);
  if (station->calibration[0] == '\0' || path[0] == '\0' || access(path, F_OK) != 0) {
    return;
  }
  if (clt_calibration_date(path, &kept, &problem) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "the configured calibration is used, the geometry is perhaps older: %s", problem.message);
  } else if (clt_calibration_date(station->calibration, &configured, NULL) == CLT_OK && kept >= configured) {
    snprintf(station->calibration, sizeof station->calibration, "%s", path);
  }
}

typedef struct reporter {
  bool (*progress)(void *context, const clt_progress *made);
  void *context;
  int64_t started_ns;
} reporter;

static bool report(void *context, const char *phase, int done, int total) {
  const reporter *self = context;
  double seconds = clt_clock_since(self->started_ns);
  const clt_progress made = {.phase = phase,
                             .done = done,
                             .total = total,
                             .seconds = seconds,
                             .left = done > 0 ? seconds * (total - done) / done : -1};
  return self->progress(self->context, &made);
}

/* A rig on the new calibration; the old ones stay where that cannot be. */
static clt_status adopt(const measure_job *job, clt_station *station, clt_projector *projector, clt_calibration *made,
                        clt_error *error) {
  clt_calibration *before = station->calibration;
  clt_rig *rig = station->rig;
  station->calibration = made;
  station->rig = NULL;
  clt_status status = clt_station_open_rig(&job->config, station, projector, error);
  if (status != CLT_OK) {
    station->calibration = before;
    station->rig = rig;
    return status;
  }
  rig->operations->close(rig);
  clt_calibration_destroy(before);
  return CLT_OK;
}

static void keep(const measure_job *job, const clt_calibration *made) {
  clt_error problem = {0};
  if (job->calibration[0] == '\0' || clt_calibration_save(made, job->calibration, &problem) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "the new geometry will not survive a restart: %s",
            job->calibration[0] == '\0' ? "the state directory's path is too long" : problem.message);
  }
}

/* What the checks of a calibration refuse is worse than what there is; a device that fails is tried again. */
static clt_status stay(clt_status status, geometry_renewal *found, clt_error *error) {
  if (status != CLT_FAILED && status != CLT_BAD_INPUT) {
    return status;
  }
  snprintf(found->why, sizeof found->why, "%s", error->message);
  *error = (clt_error){0};
  return CLT_OK;
}

clt_status geometry_renew(const measure_job *job, clt_station *station, clt_projector *projector,
                          bool (*progress)(void *context, const clt_progress *made), void *context,
                          geometry_renewal *found, clt_error *error) {
  reporter reporting = {progress, context, clt_clock_ns()};
  const clt_rig_config rig = clt_station_rig_config(&job->config, station);
  const clt_calibrate_options options = {
      .timeout_s = rig.timeout_s, .attempts = rig.attempts, .progress = report, .context = &reporting};
  clt_calibration *made = NULL;
  double moved = 0;
  *found = (geometry_renewal){.measured = true};
  clt_status status = clt_calibrate_geometry(station->calibration, projector, station->camera, &options, &made, error);
  status = status == CLT_OK ? clt_calibration_moved(station->calibration, made, &moved, error) : status;
  status = status == CLT_OK ? adopt(job, station, projector, made, error) : status;
  if (status != CLT_OK) {
    clt_calibration_destroy(made);
    return stay(status, found, error);
  }
  keep(job, made);
  found->adopted = true;
  found->covered = clt_calibration_describe(made).covered;
  found->moved = moved;
  return CLT_OK;
}
