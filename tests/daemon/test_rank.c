/* What threads ask of the system, as the system tells it. */
#include "daemon/rank.h"

#include <errno.h>
#include <sched.h>
#include <stdint.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "support.h"

static int niceness(void) {
  errno = 0;
  const int found = getpriority(PRIO_PROCESS, (id_t)gettid());
  assert_int_equal(errno, 0);
  return found;
}

static void a_thread_goes_behind_by_steps(void **state) {
  (void)state;
  const int before = niceness();
  rank_behind(2);
  assert_int_equal(niceness(), before + 2 > 19 ? 19 : before + 2);
  const int behind = niceness();
  const bool may = setpriority(PRIO_PROCESS, (id_t)gettid(), behind - 1) == 0;
  setpriority(PRIO_PROCESS, (id_t)gettid(), behind);
  rank_before(1);
  assert_int_equal(niceness(), may ? behind - 1 : behind);
}

/* The slice that the kernel has for this thread, us; 0 where it does not tell. */
static uint64_t slice_us(void) {
  struct {
    uint32_t size, policy;
    uint64_t flags;
    uint32_t nice, priority;
    uint64_t runtime_ns, rest[2];
  } found = {0};
  return syscall(SYS_sched_getattr, 0, &found, sizeof found, 0) == 0 ? found.runtime_ns / 1000 : 0;
}

static void turns_are_as_long_as_asked(void **state) {
  (void)state;
  const int before = niceness();
  rank_take_turns(RANK_REFRESH);
  const uint64_t short_us = slice_us();
  rank_take_turns(RANK_LONG);
  assert_int_equal(niceness(), before);
  if (short_us == 0) {
    skip(); /* an older kernel */
  }
  assert_in_range(short_us, 8000, 16666); /* most of a refresh */
  assert_true(slice_us() > 5 * short_us);
}

static void a_thread_keeps_off_the_last_processor_and_comes_back(void **state) {
  (void)state;
  static const rank_spot spots[] = {RANK_ASIDE, RANK_ALL, RANK_ASIDE, RANK_ALL};
  cpu_set_t before, now;
  assert_int_equal(sched_getaffinity(0, sizeof before, &before), 0);
  const int count = CPU_COUNT(&before);
  rank_place place = rank_stand();
  assert_true(CPU_EQUAL(&place.given, &before));
  for (size_t turn = 0; turn < sizeof spots / sizeof *spots; turn++) {
    rank_keep(&place, spots[turn]);
    assert_int_equal(sched_getaffinity(0, sizeof now, &now), 0);
    for (int k = 0, seen = 0; k < CPU_SETSIZE; k++) {
      seen += CPU_ISSET(k, &before) != 0;
      const bool kept = CPU_ISSET(k, &before) && (count == 1 || spots[turn] == RANK_ALL || seen < count);
      assert_int_equal(CPU_ISSET(k, &now) != 0, kept);
    }
  }
}

/* Work that takes longer than there is time for, by one thread, gets all. */
static void work_takes_as_many_threads_as_it_needs(void **state) {
  (void)state;
  rank_work work = {.all = 4};
  rank_begin(&work, 1, 0.01);
  assert_int_equal(work.taken, 3);
  work.needed_s = 0.031;
  rank_begin(&work, 1, 0.01);
  assert_int_equal(work.taken, 4);
  work.needed_s = 0;
  rank_begin(&work, 4, 0.01);
  assert_int_equal(work.taken, 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(turns_are_as_long_as_asked),
      cmocka_unit_test(a_thread_keeps_off_the_last_processor_and_comes_back),
      cmocka_unit_test(work_takes_as_many_threads_as_it_needs),
      cmocka_unit_test(a_thread_goes_behind_by_steps), /* for good */
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
