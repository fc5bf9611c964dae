#include "process.h"

#include <signal.h>
#include <time.h>

static volatile sig_atomic_t leaving;

static void on_signal(int number) {
  (void)number;
  leaving = 1;
}

int64_t process_now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

void process_heed_signals(void) {
  signal(SIGTERM, on_signal);
  signal(SIGINT, on_signal);
  signal(SIGPIPE, SIG_IGN);
}

bool process_is_leaving(void) {
  return leaving != 0;
}
