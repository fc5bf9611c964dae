#include "base/turns.h"

#include <omp.h>

bool clt_turns_next(clt_turns *turns, size_t *turn) {
  const size_t threads = (size_t)omp_get_num_threads(), me = (size_t)omp_get_thread_num();
  const size_t owners = threads < CLT_TURNS_OWNERS ? threads : CLT_TURNS_OWNERS;
  for (size_t k = 0; k < owners; k++) {
    const size_t owner = (me + k) % owners;
    const size_t first = turns->count * owner / owners, end = turns->count * (owner + 1) / owners;
    const size_t at = first + __atomic_fetch_add(&turns->taken[owner][0], 1, __ATOMIC_RELAXED);
    if (at < end) {
      *turn = at;
      return true;
    }
  }
  return false;
}
