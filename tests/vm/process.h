/* What the programs of the guest share: the clock, and leaving when told to. */
#ifndef VM_PROCESS_H
#define VM_PROCESS_H

#include <stdbool.h>
#include <stdint.h>

/* Nanoseconds of CLOCK_MONOTONIC. */
int64_t process_now_ns(void);
/* From now on SIGTERM and SIGINT make process_is_leaving true; a socket without a reader is an error, not the end. */
void process_heed_signals(void);
bool process_is_leaving(void);

#endif
