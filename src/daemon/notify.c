#include "daemon/notify.h"

#include <inttypes.h>
#include <systemd/sd-daemon.h>

#include "base/clock.h"

void notify_init(notifier *self) {
  *self = (notifier){0};
  if (sd_watchdog_enabled(0, &self->watchdog_usec) <= 0) {
    self->watchdog_usec = 0;
  }
}

void notify_picture(notifier *self) {
  if (!self->ready) {
    self->ready = true;
    sd_notify(0, "READY=1");
  }
}

void notify_status(const char *line) {
  sd_notifyf(0, "STATUS=%s", line);
}

void notify_reloading(void) {
  sd_notifyf(0, "RELOADING=1\nMONOTONIC_USEC=%lld", (long long)(clt_clock_ns() / 1000));
}

void notify_reloaded(const notifier *self) {
  if (self->ready) {
    sd_notify(0, "READY=1");
  }
}

void notify_stopping(void) {
  sd_notify(0, "STOPPING=1");
}

void notify_turns(notifier *self, uint64_t turns) {
  if (self->watchdog_usec > 0 && turns != self->fed_turns) {
    self->fed_turns = turns;
    sd_notify(0, "WATCHDOG=1");
  }
}

void notify_patience(notifier *self, bool patient) {
  if (self->watchdog_usec == 0 || patient == self->patient) {
    return;
  }
  self->patient = patient;
  uint64_t usec = NOTIFY_PATIENCE_S * UINT64_C(1000000);
  sd_notifyf(0, "WATCHDOG_USEC=%" PRIu64, patient && usec > self->watchdog_usec ? usec : self->watchdog_usec);
}
