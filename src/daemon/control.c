#include "daemon/control.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/log.h"
#include "base/memory.h"
#include "daemon/resume.h"
#include "daemon/store.h"

void control_arm(sd_event_source *timer, double seconds) {
  sd_event_source_set_time_relative(timer, (uint64_t)(seconds * 1e6));
  sd_event_source_set_enabled(timer, SD_EVENT_ONESHOT);
}

void control_blame(control *self, const clt_error *error) {
  snprintf(self->why, sizeof self->why, "%s", error->message);
  char line[CLT_MESSAGE_MAX + 32];
  snprintf(line, sizeof line, "%s: %s", machine_state_name(self->state), error->message);
  control_note(self, CLT_LOG_ERROR, line);
}

/* What follows from having come into a state, whichever way. */
static void arrive(control *self) {
  char line[CLT_MESSAGE_MAX];
  self->since = time(NULL);
  if (self->state == STATE_SHOWING) {
    self->attempt = 0;
    self->why[0] = '\0';
    if (self->config.verify_s > 0) {
      control_arm(self->verify, self->config.verify_s);
    }
  }
  control_status_line(self, line, sizeof line);
  notify_status(line);
  control_note(self, CLT_LOG_INFO, line);
  server_notify(self->service, "state", control_state_note(self));
}

/* A snapshot waits for the photograph only as long as one is being taken. */
static void release_snapshot(control *self) {
  if (self->wishes.snapshot && self->state != STATE_VERIFYING) {
    self->wishes.snapshot = false;
    control_want(self, SOLVER_SNAPSHOT);
  }
}

bool control_event(control *self, machine_event event) {
  machine_transition transition = machine_step(self->state, event);
  if (transition.action == ACTION_REFUSE) {
    return false;
  }
  bool moves = transition.next != self->state;
  self->wishes.anew = self->wishes.anew || event == EVENT_REACQUIRE || event == EVENT_CHANGED;
  self->state = transition.next;
  if (moves) {
    arrive(self);
  }
  control_act(self, transition.action);
  release_snapshot(self);
  return true;
}

/* Settings that hold from now on; what needs a restart stays as it was. */
static void adopt_config(control *self, const daemon_config *wanted) {
  daemon_config merged;
  daemon_config_copy(wanted, &merged);
  merged.station = self->config.station;
  memcpy(merged.socket, self->config.socket, sizeof merged.socket);
  memcpy(merged.state, self->config.state, sizeof merged.state);
  memcpy(merged.group, self->config.group, sizeof merged.group);
  bool other_content = strcmp(merged.content, self->config.content) != 0;
  daemon_config_copy(&merged, &self->config);
  if (other_content) {
    self->wishes.content_ticket = ++self->tickets;
    control_want(self, SOLVER_CONTENT);
  } else {
    control_event(self, EVENT_PICTURE); /* method, tolerance or white may have changed */
  }
}

clt_status control_reload(control *self, const char **restart, clt_error *error) {
  daemon_config wanted;
  notify_reloading();
  clt_status status = daemon_config_read(self->config.path, &self->overrides, &wanted, error);
  if (status == CLT_OK) {
    *restart = daemon_config_needs_restart(&self->config, &wanted);
    adopt_config(self, &wanted);
    clt_log(CLT_LOG_NOTICE, "%s: read again%s%s", self->config.path, *restart != NULL ? "; restart for: " : "",
            *restart != NULL ? *restart : "");
  } else {
    clt_log(CLT_LOG_ERROR, "the configuration stays as it was: %s", error->message);
  }
  notify_reloaded(&self->notify);
  return status;
}

static int on_signal(sd_event_source *source, const struct signalfd_siginfo *signal, void *userdata) {
  (void)source;
  control *self = userdata;
  clt_error error = {0};
  const char *restart = NULL;
  if (signal->ssi_signo == SIGHUP) {
    control_reload(self, &restart, &error);
  } else {
    clt_log(CLT_LOG_NOTICE, "asked to stop by signal %u", signal->ssi_signo);
    control_event(self, EVENT_STOP);
  }
  return 0;
}

static void take_frames(control *self, output_frames *letter) {
  bool first = letter->picture && !self->found.frames.picture;
  self->found.frames = *letter;
  notify_turns(&self->notify, letter->turns);
  if (first) {
    char line[CLT_MESSAGE_MAX];
    notify_picture(&self->notify);
    control_status_line(self, line, sizeof line);
    notify_status(line);
  }
  if (letter->ended) {
    server_flush(self->service);
    sd_event_exit(self->loop, 0);
  }
}

static void take_progress(control *self, measure_progress *letter) {
  if (letter->number == self->work.measure_number && self->state == STATE_ACQUIRING) {
    self->found.progress = *letter;
    self->wishes.anew = false; /* it has begun: from here on it is resumed */
    server_notify_latest(self->service, "progress", control_progress_note(letter));
  }
}

/* Empties every mailbox that leads here. Progress goes first: it is older than the result. */
static int on_wake(sd_event_source *source, int descriptor, uint32_t events, void *userdata) {
  (void)source, (void)events;
  control *self = userdata;
  const daemon_boxes *boxes = self->boxes;
  eventfd_t count;
  eventfd_read(descriptor, &count);
  measure_progress *progress = clt_mailbox_take(boxes->progress, 0);
  if (progress != NULL) {
    take_progress(self, progress);
    free(progress);
  }
  output_opened *opened = clt_mailbox_take(boxes->opened, 0);
  if (opened != NULL) {
    control_on_opened(self, opened);
    free(opened);
  }
  measure_result *measured = clt_mailbox_take(boxes->measured, 0);
  if (measured != NULL) {
    control_on_measured(self, measured);
    measure_result_free(measured);
  }
  solver_result *solved = clt_mailbox_take(boxes->solved, 0);
  if (solved != NULL) {
    control_on_solved(self, solved);
    solver_result_free(solved);
  }
  moving_report *moved = clt_mailbox_take(boxes->moved, 0);
  if (moved != NULL) {
    control_on_moved(self, moved);
    free(moved);
  }
  output_frames *frames = clt_mailbox_take(boxes->frames, 0);
  if (frames != NULL) {
    take_frames(self, frames);
    free(frames);
  }
  return 0;
}

static int on_retry(sd_event_source *source, uint64_t usec, void *userdata) {
  (void)source, (void)usec;
  control_event(userdata, EVENT_RETRY);
  return 0;
}

static int on_verify(sd_event_source *source, uint64_t usec, void *userdata) {
  (void)source, (void)usec;
  control_event(userdata, EVENT_VERIFY);
  return 0;
}

/* What the other threads still do cannot be interrupted (a solve, a device being opened) and harms nothing: files are
 * replaced as a whole. */
static int on_grace(sd_event_source *source, uint64_t usec, void *userdata) {
  (void)source, (void)usec;
  control *self = userdata;
  clt_log(CLT_LOG_NOTICE, "stopped without waiting for work that cannot be interrupted");
  listener_close(self->listening);
  _exit(EXIT_SUCCESS);
}

static int add_timer(control *self, sd_event_source **timer, sd_event_time_handler_t handler) {
  int outcome = sd_event_add_time(self->loop, timer, CLOCK_MONOTONIC, 0, 10000, handler, self);
  return outcome < 0 ? outcome : sd_event_source_set_enabled(*timer, SD_EVENT_OFF);
}

static int add_sources(control *self) {
  static const int numbers[] = {SIGTERM, SIGINT, SIGHUP};
  int outcome = sd_event_add_io(self->loop, &self->wake, self->boxes->wake, EPOLLIN, on_wake, self);
  for (int i = 0; outcome >= 0 && i < 3; i++) {
    outcome = sd_event_add_signal(self->loop, &self->signals[i], numbers[i], on_signal, self);
  }
  const struct {
    sd_event_source **timer;
    sd_event_time_handler_t handler;
  } timers[] = {{&self->retry, on_retry}, {&self->verify, on_verify}, {&self->grace, on_grace}};
  for (size_t i = 0; outcome >= 0 && i < sizeof timers / sizeof timers[0]; i++) {
    outcome = add_timer(self, timers[i].timer, timers[i].handler);
  }
  return outcome;
}

static clt_status make_loop(control *self, clt_error *error) {
  int outcome = sd_event_new(&self->loop);
  outcome = outcome < 0 ? outcome : add_sources(self);
  if (outcome < 0) {
    return clt_fail(error, CLT_FAILED, "the control loop cannot be made: %s", strerror(-outcome));
  }
  gid_t group = self->config.group[0] != '\0' ? peer_group(self->config.group) : (gid_t)-1;
  return server_create(self->loop, self->listening->descriptor, group, control_on_request, self, &self->service, error);
}

clt_status control_create(const daemon_boxes *boxes, listener *listening, const daemon_config *config,
                          const daemon_overrides *overrides, const char *content, control **out, clt_error *error) {
  control *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "the control loop: out of memory");
  }
  *self = (control){.boxes = boxes, .listening = listening, .overrides = *overrides, .since = time(NULL)};
  daemon_config_copy(config, &self->config);
  self->wishes.content_descriptor = -1;
  self->wishes.acquire = !config->reuse;
  char journal[CLT_PATH_MAX];
  store_journal_path(config->state, journal);
  self->wishes.owed = config->reuse && resume_is_owed(journal);
  self->found.content_serial = 1;
  self->found.verified_error = -1;
  snprintf(self->found.content, sizeof self->found.content, "%s", content);
  notify_init(&self->notify);
  clt_status status = make_loop(self, error);
  if (status != CLT_OK) {
    control_destroy(self);
    return status;
  }
  *out = self;
  return CLT_OK;
}

void *control_run(void *data) {
  control *self = data;
  const char *socket = self->listening->bound ? self->listening->path : "passed by systemd";
  clt_log(CLT_LOG_NOTICE, "counterlightd %s: configuration %s, control socket %s, state directory %s", CLT_VERSION,
          self->config.path, socket, self->config.state);
  control_act(self, ACTION_OPEN);
  sd_event_loop(self->loop);
  return NULL;
}

void control_destroy(control *self) {
  if (self == NULL) {
    return;
  }
  sd_event_source *sources[] = {self->wake,  self->signals[0], self->signals[1], self->signals[2],
                                self->retry, self->verify,     self->grace};
  server_destroy(self->service);
  for (size_t i = 0; i < sizeof sources / sizeof sources[0]; i++) {
    sd_event_source_disable_unref(sources[i]);
  }
  sd_event_unref(self->loop);
  control_finish_jobs(self);
  free(self);
}
