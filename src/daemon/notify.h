/* What systemd is told (sd_notify). Without a NOTIFY_SOCKET all of it does nothing. */
#ifndef CLT_DAEMON_NOTIFY_H
#define CLT_DAEMON_NOTIFY_H

#include <stdbool.h>
#include <stdint.h>

typedef struct notifier {
  bool ready;             /* READY=1 was sent */
  uint64_t watchdog_usec; /* 0: systemd wants no watchdog */
  uint64_t fed_turns;     /* the output's turns when the watchdog was fed last */
} notifier;

void notify_init(notifier *self);
/* A picture is up: READY=1, the first time. */
void notify_picture(notifier *self);
void notify_status(const char *line);
void notify_reloading(void);
/* The end of a reload. */
void notify_reloaded(const notifier *self);
void notify_stopping(void);
/* Feeds the watchdog where the output has turned since the last feeding, or is excused (devices being opened). */
void notify_watchdog(notifier *self, uint64_t turns, bool excused);

#endif
