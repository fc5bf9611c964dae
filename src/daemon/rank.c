#include "daemon/rank.h"

#include <errno.h>
#include <omp.h>
#include <stdint.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

/* Linux keeps niceness by threads. */
void rank_behind(int steps) {
  const id_t self = (id_t)gettid();
  errno = 0;
  const int niceness = getpriority(PRIO_PROCESS, self);
  if (errno == 0) {
    setpriority(PRIO_PROCESS, self, niceness + steps);
  }
}

void rank_before(int steps) {
  rank_behind(-steps);
}

/* As the kernel lays it out, of which headers disagree. */
typedef struct attributes {
  uint32_t size, policy;
  uint64_t flags;
  int32_t nice;
  uint32_t priority;
  uint64_t runtime_ns, deadline_ns, period_ns;
} attributes;

/* Linux keeps slices by threads as well, from 6.12 on; before, it takes no notice. */
void rank_take_turns(rank_turn turn) {
  static const uint64_t slice_us[] = {[RANK_REFRESH] = 12000, [RANK_LONG] = 100000};
  attributes own = {.size = sizeof own};
  if (syscall(SYS_sched_getattr, 0, &own, sizeof own, 0) == 0) {
    own.runtime_ns = 1000 * slice_us[turn];
    syscall(SYS_sched_setattr, 0, &own, 0);
  }
}

rank_place rank_stand(void) {
  rank_place place = {.spot = RANK_ALL};
  CPU_ZERO(&place.given);
  sched_getaffinity(0, sizeof place.given, &place.given);
  return place;
}

void rank_keep(rank_place *place, rank_spot spot) {
  cpu_set_t taken = place->given;
  int last = CPU_SETSIZE - 1;
  if (spot == place->spot || CPU_COUNT(&taken) < 2) {
    return;
  }
  while (!CPU_ISSET(last, &taken)) {
    last--;
  }
  if (spot == RANK_ASIDE) {
    CPU_CLR(last, &taken);
  }
  sched_setaffinity(0, sizeof taken, &taken);
  place->spot = spot;
}

/* Seconds of a processor that the calling thread has had. */
static double spent_s(void) {
  struct timespec spent = {0};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &spent);
  return (double)spent.tv_sec + 1e-9 * (double)spent.tv_nsec;
}

rank_work rank_open(void) {
  return (rank_work){.all = omp_get_max_threads()};
}

void rank_begin(rank_work *work, int others, double within_s) {
  const int fewer = work->all > others + 1 ? work->all - others : 1;
  work->taken = work->needed_s <= within_s * fewer ? fewer : work->all;
  omp_set_num_threads(work->taken);
  work->began_s = spent_s();
}

/* The threads of a loop work equally long. What counts is the mean over a second or so: a peak is no reason to wait for
 * each other. */
void rank_end(rank_work *work) {
  const double gain = 0.02;
  work->needed_s += gain * ((spent_s() - work->began_s) * work->taken - work->needed_s);
}
