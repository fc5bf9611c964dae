#include "daemon/rank.h"

#include <errno.h>
#include <omp.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

/* Linux keeps niceness by threads. Where it cannot be had, all are alike. */
void rank_behind(int steps) {
  const id_t self = (id_t)gettid();
  errno = 0;
  const int niceness = getpriority(PRIO_PROCESS, self);
  if (errno == 0) {
    setpriority(PRIO_PROCESS, self, niceness + steps);
  }
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
