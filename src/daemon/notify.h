/* What systemd is told (sd_notify). Without a NOTIFY_SOCKET all of it does nothing. */
#ifndef CLT_DAEMON_NOTIFY_H
#define CLT_DAEMON_NOTIFY_H

#include <stdbool.h>
#include <stdint.h>

enum { NOTIFY_PATIENCE_S = 120 };

typedef struct notifier {
  bool ready;             /* READY=1 was sent */
  uint64_t watchdog_usec; /* 0: systemd wants no watchdog */
  uint64_t fed_turns;     /* the output's turns when the watchdog was fed last */
  bool patient;           /* the watchdog waits longer than the unit says */
} notifier;

void notify_init(notifier *self);
/* A picture is up: READY=1, the first time. */
void notify_picture(notifier *self);
void notify_status(const char *line);
void notify_reloading(void);
/* The end of a reload. */
void notify_reloaded(const notifier *self);
void notify_stopping(void);
/* The output has reported: feeds the watchdog where it has turned since the last feeding. */
void notify_turns(notifier *self, uint64_t turns);
/* Makes the watchdog wait up to NOTIFY_PATIENCE_S for the output, which may be held up (devices being opened or
 * closed), or again only as long as the unit says. */
void notify_patience(notifier *self, bool patient);

#endif
