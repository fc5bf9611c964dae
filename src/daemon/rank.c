#include "daemon/rank.h"

#include <errno.h>
#include <omp.h>
#include <sys/resource.h>
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

void rank_share(int threads) {
  omp_set_num_threads(threads > 1 ? threads : 1);
}

int rank_threads(void) {
  return omp_get_max_threads();
}
