#include "daemon/notify.h"

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

void notify_watchdog(notifier *self, uint64_t turns, bool excused) {
  if (turns != self->fed_turns || excused) {
    self->fed_turns = turns;
    sd_notify(0, "WATCHDOG=1");
  }
}
