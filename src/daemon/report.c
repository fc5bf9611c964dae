/* What clients are told. */
#include <math.h>
#include <stdio.h>

#include "base/file.h"
#include "daemon/control.h"
#include "daemon/journal.h"

/* A time as 2026-01-31T12:00:00Z. */
static json_t *iso_time(time_t when) {
  char text[32];
  struct tm parts;
  gmtime_r(&when, &parts);
  strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return json_string(text);
}

/* A number that is not known while it is negative. */
static json_t *known(double value) {
  return value >= 0 ? json_real(value) : json_null();
}

/* A text that is no UTF-8 (a path may be) is given as null. */
static json_t *text_or_null(const char *text) {
  json_t *made = text[0] != '\0' ? json_string(text) : NULL;
  return made != NULL ? made : json_null();
}

json_t *control_state_note(const control *self) {
  return json_pack("{s:s, s:o, s:o}", "state", machine_state_name(self->state), "since", iso_time(self->since), "why",
                   text_or_null(self->why));
}

json_t *control_progress_note(const measure_progress *progress) {
  return json_pack("{s:s, s:I, s:I, s:I, s:f, s:o}", "phase", progress->phase, "done", (json_int_t)progress->done,
                   "total", (json_int_t)progress->total, "resumed", (json_int_t)progress->resumed, "seconds",
                   progress->seconds, "left", known(progress->left));
}

static json_t *transport_note(const transport_facts *transport) {
  if (!transport->present) {
    return json_null();
  }
  const clt_provenance *origin = &transport->origin;
  json_t *acquired = origin->acquired > 0 ? iso_time((time_t)origin->acquired) : json_null();
  json_t *note = json_pack("{s:{s:i, s:i, s:i}, s:o, s:i, s:o}", "grid", "width", transport->info.width, "height",
                           transport->info.height, "channels", transport->info.channels, "acquired", acquired,
                           "patterns", origin->patterns, "error", known(origin->error));
  json_object_set_new(note, "seconds", json_real(origin->seconds));
  json_object_set_new(note, "scheme", text_or_null(origin->scheme));
  json_object_set_new(note, "source", text_or_null(origin->source));
  return note;
}

json_t *control_verify_note(const control *self) {
  const control_findings *found = &self->found;
  if (found->verified_error < 0) {
    return json_null();
  }
  json_t *note = json_pack("{s:f, s:o}", "error", found->verified_error, "at", iso_time(found->verified));
  bool known_fit = found->checked;
  json_object_set_new(note, "off", known_fit ? json_real(found->fit.off) : json_null());
  json_object_set_new(note, "noise", known_fit ? json_real(found->fit.noise) : json_null());
  json_object_set_new(note, "limit", known_fit ? json_real(found->fit.limit) : json_null());
  json_object_set_new(note, "fits", known_fit ? json_boolean(found->fit.fits) : json_null());
  const refinement *refined = &found->refined;
  json_object_set_new(note, "refined",
                      refined->photographs > 0
                          ? json_pack("{s:f, s:f, s:f, s:i}", "before", refined->before, "after", refined->after,
                                      "noise", refined->noise, "photographs", refined->photographs)
                          : json_null());
  return note;
}

json_t *control_drift_note(const control *self) {
  trend_slopes slopes;
  if (!trend_measure(&self->found.trend, &slopes)) {
    return json_null();
  }
  return json_pack("{s:I, s:f, s:f, s:f, s:f, s:b}", "photographs", (json_int_t)self->found.trend.count,
                   "error_per_hour", slopes.error, "error_deviation", slopes.error_deviation, "brightness_per_hour",
                   slopes.brightness, "brightness_deviation", slopes.brightness_deviation, "passes",
                   self->found.drifts);
}

static json_t *geometry_note(const geometry_renewal *geometry) {
  if (!geometry->measured) {
    return json_null();
  }
  return json_pack("{s:b, s:o, s:o, s:o}", "adopted", geometry->adopted, "covered",
                   geometry->adopted ? json_real(geometry->covered) : json_null(), "moved",
                   geometry->adopted && isfinite(geometry->moved) ? json_real(geometry->moved) : json_null(), "why",
                   text_or_null(geometry->why));
}

json_t *control_renewed_note(const control *self) {
  static const char *const names[] = {[RENEW_NONE] = "kept",
                                      [RENEW_FITS] = "nothing",
                                      [RENEW_GAIN] = "gain",
                                      [RENEW_REPAINT] = "repaint",
                                      [RENEW_MEASURE] = "transport"};
  const renewal *renewed = &self->found.renewed;
  if (renewed->outcome == RENEW_NONE && !renewed->geometry.measured) {
    return json_null();
  }
  return json_pack("{s:s, s:i, s:I, s:f, s:f, s:f, s:b, s:o}", "done", names[renewed->outcome], "patterns",
                   renewed->patterns, "rows", (json_int_t)renewed->rows, "off_before", renewed->before.off, "off_after",
                   renewed->after.off, "limit", renewed->after.limit, "fits", renewed->after.fits, "geometry",
                   geometry_note(&renewed->geometry));
}

json_t *control_moving_note(const control *self) {
  const moving_report *moved = &self->found.moved;
  const clt_frames_result *last = &moved->last;
  if (moved->serial != self->found.content_serial || self->work.playing.path[0] == '\0') {
    return json_null();
  }
  json_t *note = json_pack("{s:I, s:I, s:I, s:I, s:I, s:f, s:b, s:f}", "frames", (json_int_t)moved->frames, "late",
                           (json_int_t)moved->late, "slow", (json_int_t)moved->slow, "skipped",
                           (json_int_t)moved->skipped, "slipped", (json_int_t)moved->slipped, "fps", moved->fps,
                           "compensated", moved->compensated, "ms", moved->ms);
  json_object_set_new(note, "why", text_or_null(moved->why));
  if (moved->compensated) {
    json_object_set_new(note, "direct", json_integer((json_int_t)moved->direct));
    json_object_set_new(note, "error", last->direct ? json_null() : json_real(last->live.error));
    json_object_set_new(note, "scale", json_real(last->scale));
    json_object_set_new(note, "offset", json_real(last->offset));
    json_object_set_new(note, "stages",
                        json_pack("{s:f, s:f, s:f, s:f}", "mean_ms", last->ms[CLT_FRAMES_MEAN], "map_ms",
                                  last->ms[CLT_FRAMES_MAP], "solve_ms", last->ms[CLT_FRAMES_SOLVE], "fields_ms",
                                  last->ms[CLT_FRAMES_FIELDS]));
  }
  return note;
}

static json_t *frame_note(const control_findings *found) {
  const clt_compensation *made = &found->picture.compensation;
  bool compensated = found->picture.compensated;
  json_t *note = json_pack("{s:f, s:I, s:I, s:b, s:b}", "fps", found->frames.fps, "late",
                           (json_int_t)found->frames.late, "presented", (json_int_t)found->frames.presented,
                           "compensated", compensated, "recalled", found->picture.recalled);
  json_object_set_new(note, "solve_ms", compensated ? known(1e3 * made->solve.seconds) : json_null());
  json_object_set_new(note, "error", compensated ? known(made->error_after) : json_null());
  json_object_set_new(note, "error_before", compensated ? known(made->error_before) : json_null());
  json_object_set_new(note, "method", compensated ? json_string(made->solve.method) : json_null());
  json_object_set_new(note, "verified_error", known(found->verified_error));
  json_object_set_new(note, "verified", found->verified_error >= 0 ? iso_time(found->verified) : json_null());
  return note;
}

/* What the present accuracy costs, what more or less of it would, and what limits it. */
static void cost_sentence(const control_findings *found, char *text, size_t size) {
  const clt_compensation *made = &found->picture.compensation;
  if (!found->picture.compensated) {
    snprintf(text, size, "the picture is not compensated: that costs nothing, and interreflection stays");
    return;
  }
  const char *measured = json_string_value(json_object_get(found->tradeoff, "sentence"));
  int used = snprintf(text, size, "%.2g %% error costs %.3g ms a picture by %s%s%s", 100 * made->error_after,
                      1e3 * made->solve.seconds, made->solve.method, measured != NULL ? "; " : "",
                      measured != NULL ? measured : "");
  if (found->transport.origin.error >= 0 && used > 0 && (size_t)used < size) {
    snprintf(text + used, size - (size_t)used, "; the acquisition's own error is %.2g %%",
             100 * found->transport.origin.error);
  }
}

static json_t *devices_note(const control_findings *found) {
  if (!found->open) {
    return json_null();
  }
  const clt_projector_info *panel = &found->devices.projector;
  json_t *note = json_pack("{s:s, s:o, s:o, s:[i, i], s:f}", "projector", found->devices.projector_name, "camera",
                           text_or_null(found->camera), "source", text_or_null(found->source), "panel", panel->width,
                           panel->height, "refresh_hz", panel->refresh_s > 0 ? 1 / panel->refresh_s : 0.0);
  const camera_frames *frames = &found->camera_frames;
  json_object_set_new(note, "frames",
                      json_pack("{s:I, s:I, s:I, s:I}", "used", (json_int_t)frames->used, "repeated",
                                (json_int_t)frames->repeated, "strange", (json_int_t)frames->strange, "torn",
                                (json_int_t)frames->torn));
  return note;
}

json_t *control_status(const control *self) {
  char cost[CLT_MESSAGE_MAX + CLT_TRADEOFF_SENTENCE_MAX];
  json_t *status = control_state_note(self);
  cost_sentence(&self->found, cost, sizeof cost);
  json_object_set_new(status, "version", json_string(CLT_VERSION));
  json_object_set_new(status, "content", text_or_null(self->found.content));
  json_object_set_new(status, "transport", transport_note(&self->found.transport));
  json_t *frame = frame_note(&self->found);
  json_object_set_new(frame, "moving", control_moving_note(self));
  json_object_set_new(status, "frame", frame);
  json_object_set_new(status, "verify", control_verify_note(self));
  json_object_set_new(status, "reacquired", control_renewed_note(self));
  json_object_set_new(status, "drift", control_drift_note(self));
  json_object_set_new(status, "cost", json_string(cost));
  json_object_set_new(status, "devices", devices_note(&self->found));
  bool acquiring = self->state == STATE_ACQUIRING && self->found.progress.number != 0;
  json_object_set_new(status, "progress", acquiring ? control_progress_note(&self->found.progress) : json_null());
  return status;
}

static json_t *snapshot_path(const control *self, const char *name, bool there) {
  char path[CLT_PATH_MAX];
  return there && clt_file_join(self->config.state, name, path, NULL) == CLT_OK ? text_or_null(path) : json_null();
}

json_t *control_snapshot_note(const control *self) {
  const control_findings *found = &self->found;
  return json_pack("{s:o, s:o, s:o}", "target",
                   snapshot_path(self, "snapshot/target.png", found->picture.target.data != NULL), "drive",
                   snapshot_path(self, "snapshot/drive.png", true), "observation",
                   snapshot_path(self, "snapshot/observation.png", found->observation.data != NULL));
}

void control_status_line(const control *self, char *line, size_t size) {
  const char *name = machine_state_name(self->state);
  if (self->state == STATE_SHOWING && self->found.picture.compensated) {
    snprintf(line, size, "%s %s, %.2g %% error", name, self->found.content,
             100 * self->found.picture.compensation.error_after);
  } else if (self->state == STATE_HOLDING && self->why[0] != '\0') {
    snprintf(line, size, "%s: %s", name, self->why);
  } else {
    snprintf(line, size, "%s", name);
  }
}

void control_note(const control *self, clt_log_level level, const char *line) {
  const control_findings *found = &self->found;
  const journal_field fields[] = {
      {"COUNTERLIGHT_STATE", machine_state_name(self->state)},
      {"COUNTERLIGHT_WHY", self->why},
      {"COUNTERLIGHT_CONTENT", found->content},
      {"COUNTERLIGHT_PROJECTOR", found->open ? found->devices.projector_name : ""},
      {"COUNTERLIGHT_CAMERA", found->camera},
  };
  journal_note(level, line, fields, sizeof fields / sizeof fields[0]);
}
