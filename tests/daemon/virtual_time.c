/* Time that passes by waiting alone, for a daemon that runs for hours: preloaded, it takes the place of what the daemon
 * waits with. When every thread waits, the clock jumps to the earliest deadline; until then nobody's comes. Work takes
 * no time but for the thread that does it, which counts what it had of the processor, so that a busy machine makes
 * nothing late. What is late by this clock is late because a thread waited for another one, or slept, where it must
 * not, or worked too long itself.
 *
 * A thread counts from the first time that it waits here on, the main one from the start. Condition variables are kept
 * here alone: whoever is woken counts as busy from that moment, not from when it runs. One epoll set is looked into
 * before each jump. */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdbool.h>
#include <stdint.h>
#include <sys/epoll.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

enum { TIMERS = 8 };
static const int64_t never_ns = INT64_MAX;

typedef struct waiter {
  struct waiter *next;
  const void *what; /* a condition variable; NULL: it sleeps */
  int64_t deadline_ns;
  bool late;
  sem_t wake;
} waiter;

typedef struct timer {
  int descriptor;
  int64_t deadline_ns;
} timer;

static struct {
  pthread_mutex_t lock;
  int64_t now_ns; /* by what was waited for */
  uint64_t jumps;
  waiter *first;
  int busy;  /* threads that do not wait */
  int epoll; /* the set that is looked into */
  bool polling;
  timer timers[TIMERS];
  int timer_count;
  pthread_key_t threads;
} world = {.lock = PTHREAD_MUTEX_INITIALIZER, .epoll = -1};

static _Thread_local bool counted;

static int64_t in_ns(const struct timespec *time) {
  return (int64_t)time->tv_sec * 1000000000 + time->tv_nsec;
}

static int64_t machine_ns(clockid_t clock) {
  struct timespec now;
  syscall(SYS_clock_gettime, clock, &now);
  return in_ns(&now);
}

/* The thread's own time: never before what it saw last. Under the lock. */
static int64_t own_ns(void) {
  static _Thread_local int64_t seen_ns, processor_ns;
  static _Thread_local uint64_t jumps;
  int64_t now_ns = machine_ns(CLOCK_THREAD_CPUTIME_ID);
  if (world.now_ns == 0) {
    world.now_ns = machine_ns(CLOCK_MONOTONIC);
  }
  if (jumps != world.jumps) {
    jumps = world.jumps;
    processor_ns = now_ns;
  }
  int64_t own_ns = world.now_ns + now_ns - processor_ns;
  seen_ns = own_ns > seen_ns ? own_ns : seen_ns;
  return seen_ns;
}

static void wake(waiter *one, bool late) {
  waiter **at = &world.first;
  while (*at != one) {
    at = &(*at)->next;
  }
  *at = one->next;
  one->late = late;
  world.busy++;
  sem_post(&one->wake);
}

static void wake_poller(void) {
  world.busy += world.polling;
  world.polling = false;
}

/* The machine's own, which this one hides. */
static int set_timer(int descriptor, int flags, const struct itimerspec *wanted, struct itimerspec *before) {
  return (int)syscall(SYS_timerfd_settime, descriptor, flags, wanted, before);
}

/* The machine's timer fires at once; whoever polls has it. */
static void fire(timer *due) {
  const struct itimerspec at_once = {.it_value.tv_nsec = 1};
  set_timer(due->descriptor, 0, &at_once, NULL);
  due->deadline_ns = never_ns;
  wake_poller();
}

static void advance(int64_t to_ns) {
  world.now_ns = to_ns > world.now_ns ? to_ns : world.now_ns;
  world.jumps++;
  for (waiter *one = world.first, *next; one != NULL; one = next) {
    next = one->next;
    if (one->deadline_ns <= world.now_ns) {
      wake(one, true);
    }
  }
  for (int i = 0; i < world.timer_count; i++) {
    if (world.timers[i].deadline_ns <= world.now_ns) {
      fire(&world.timers[i]);
    }
  }
}

static int64_t earliest(void) {
  int64_t found_ns = never_ns;
  for (const waiter *one = world.first; one != NULL; one = one->next) {
    found_ns = one->deadline_ns < found_ns ? one->deadline_ns : found_ns;
  }
  for (int i = 0; i < world.timer_count; i++) {
    int64_t deadline_ns = world.timers[i].deadline_ns;
    found_ns = deadline_ns < found_ns ? deadline_ns : found_ns;
  }
  return found_ns;
}

/* Where all wait and nothing came from outside, it is the time that somebody waits for. */
static void jump(void) {
  while (world.busy == 0) {
    struct pollfd outside = {.fd = world.epoll, .events = POLLIN};
    int64_t to_ns = earliest();
    if (world.polling && poll(&outside, 1, 0) > 0) {
      wake_poller();
    } else if (to_ns == never_ns) {
      return;
    } else {
      advance(to_ns);
    }
  }
}

static void forget_thread(void *unused) {
  (void)unused;
  pthread_mutex_lock(&world.lock);
  world.busy--;
  jump();
  pthread_mutex_unlock(&world.lock);
}

static void make_key(void) {
  pthread_key_create(&world.threads, forget_thread);
}

/* Under the lock. */
static void count_thread(void) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  if (!counted) {
    pthread_once(&once, make_key);
    pthread_setspecific(world.threads, &world);
    counted = true;
    world.busy++;
  }
}

__attribute__((constructor)) static void begin(void) {
  count_thread();
}

/* True where the deadline came first. */
static bool wait_here(const void *what, pthread_mutex_t *held, int64_t deadline_ns) {
  waiter self = {.what = what, .deadline_ns = deadline_ns};
  sem_init(&self.wake, 0, 0);
  pthread_mutex_lock(&world.lock);
  count_thread();
  waiter **at = &world.first;
  while (*at != NULL) {
    at = &(*at)->next;
  }
  *at = &self;
  world.busy--;
  if (held != NULL) {
    pthread_mutex_unlock(held);
  }
  jump();
  pthread_mutex_unlock(&world.lock);
  while (sem_wait(&self.wake) != 0) {
  }
  pthread_mutex_lock(&world.lock); /* whoever woke it is through with it */
  pthread_mutex_unlock(&world.lock);
  sem_destroy(&self.wake);
  if (held != NULL) {
    pthread_mutex_lock(held);
  }
  return self.late;
}

static void wake_waiters(const void *what, bool all) {
  bool more = true;
  pthread_mutex_lock(&world.lock);
  for (waiter *one = world.first, *next; one != NULL && more; one = next) {
    next = one->next;
    if (one->what == what) {
      wake(one, false);
      more = all;
    }
  }
  pthread_mutex_unlock(&world.lock);
}

int clock_gettime(clockid_t clock, struct timespec *out) {
  if (clock != CLOCK_MONOTONIC) {
    return (int)syscall(SYS_clock_gettime, clock, out);
  }
  pthread_mutex_lock(&world.lock);
  int64_t ns = own_ns();
  pthread_mutex_unlock(&world.lock);
  *out = (struct timespec){ns / 1000000000, ns % 1000000000};
  return 0;
}

int pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *mutex) {
  wait_here(condition, mutex, never_ns);
  return 0;
}

static int64_t now_by_our_clock(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return in_ns(&now);
}

int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t clock,
                           const struct timespec *until) {
  int64_t deadline_ns = in_ns(until);
  if (clock != CLOCK_MONOTONIC) {
    deadline_ns += now_by_our_clock() - machine_ns(clock);
  }
  return wait_here(condition, mutex, deadline_ns) ? ETIMEDOUT : 0;
}

/* Which clock the variable has is told by the time: machines are not up for decades. */
int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *until) {
  return pthread_cond_clockwait(condition, mutex, until->tv_sec > 1000000000 ? CLOCK_REALTIME : CLOCK_MONOTONIC, until);
}

int pthread_cond_signal(pthread_cond_t *condition) {
  wake_waiters(condition, false);
  return 0;
}

int pthread_cond_broadcast(pthread_cond_t *condition) {
  wake_waiters(condition, true);
  return 0;
}

int nanosleep(const struct timespec *length, struct timespec *left) {
  (void)left;
  wait_here(NULL, NULL, now_by_our_clock() + in_ns(length));
  return 0;
}

/* Who waits for another thread's end does not work. */
int pthread_join(pthread_t thread, void **result) {
  int (*join)(pthread_t, void **) = NULL;
  *(void **)&join = dlsym(RTLD_NEXT, "pthread_join");
  pthread_mutex_lock(&world.lock);
  count_thread();
  world.busy--;
  jump();
  pthread_mutex_unlock(&world.lock);
  int outcome = join(thread, result);
  pthread_mutex_lock(&world.lock);
  world.busy++;
  pthread_mutex_unlock(&world.lock);
  return outcome;
}

int timerfd_settime(int descriptor, int flags, const struct itimerspec *wanted, struct itimerspec *before) {
  const struct itimerspec nothing = {0};
  int64_t ns = in_ns(&wanted->it_value), now = now_by_our_clock();
  int outcome = set_timer(descriptor, flags, &nothing, before);
  pthread_mutex_lock(&world.lock);
  int i = 0;
  while (i < world.timer_count && world.timers[i].descriptor != descriptor) {
    i++;
  }
  if (i < TIMERS) {
    world.timer_count += i == world.timer_count;
    int64_t deadline_ns = flags & TFD_TIMER_ABSTIME ? ns : now + ns;
    world.timers[i] = (timer){descriptor, ns != 0 ? deadline_ns : never_ns};
  }
  pthread_mutex_unlock(&world.lock);
  return outcome;
}

/* The first set that is waited on without end is the control loop's. */
int epoll_wait(int set, struct epoll_event *events, int most, int timeout) {
  pthread_mutex_lock(&world.lock);
  world.epoll = world.epoll < 0 && timeout < 0 ? set : world.epoll;
  bool ours = set == world.epoll && timeout < 0;
  if (ours) {
    count_thread();
    world.polling = true;
    world.busy--;
    jump();
  }
  pthread_mutex_unlock(&world.lock);
  int count = (int)syscall(SYS_epoll_pwait, set, events, most, timeout, NULL, 0);
  if (ours) {
    int cause = errno;
    pthread_mutex_lock(&world.lock);
    wake_poller();
    pthread_mutex_unlock(&world.lock);
    errno = cause;
  }
  return count;
}
