/* Which of the daemon's threads go first where there are more of them than processors, and how many processors each
 * takes. What shows a film is a row of stages that work at the same time: where each of them takes all processors, they
 * wait for each other in the middle of their work.
 *
 * All of it is asked of the system, which may refuse: then all threads are alike. */
#ifndef CLT_DAEMON_RANK_H
#define CLT_DAEMON_RANK_H

#include <sched.h>
#include <stdbool.h>

/* Steps of niceness between what a program does at once, what is computed ahead of its time, what is decoded ahead of
 * that, and what has no time at all (a new drive, what accuracy costs). */
enum { RANK_AHEAD = 5 };

/* By how much what stands on the glass goes before what other programs do, where the process may (LimitNICE=). */
enum { RANK_FIRST = 10 };

/* Lets the calling thread, and those that it starts from now on, go behind the others by so many steps, or before them.
 */
void rank_behind(int steps);
void rank_before(int steps);

/* How long a processor works on a thread, once it has begun, before it looks at others: what has to be ready within a
 * refresh asks for most of one; what has longer, for longer, and is interrupted by the former whenever they wake. */
typedef enum rank_turn { RANK_REFRESH, RANK_LONG } rank_turn;
void rank_take_turns(rank_turn turn);

/* Where a thread runs among the processors that it was given: on all, or on all but the last. So work that is done
 * ahead of its time finds one on which it is not interrupted by what has to be done at once. */
typedef enum rank_spot { RANK_ALL, RANK_ASIDE } rank_spot;
typedef struct rank_place {
  cpu_set_t given;
  rank_spot spot;
} rank_place;
/* Of the calling thread. */
rank_place rank_stand(void);
/* The calling thread, and those that it starts from now on. Of one processor, all. */
void rank_keep(rank_place *place, rank_spot spot);

/* Work that the calling thread does again and again, by loops that are shared among threads. */
typedef struct rank_work {
  int all, taken;  /* threads: that there are, that the work has now */
  double needed_s; /* of one processor, each time, smoothed */
  double began_s;
} rank_work;

rank_work rank_open(void);
/* The work begins: by as many threads as leave `others` of them to others, 1 at least, where that takes no longer than
 * within_s by what it took so far, else by all. */
void rank_begin(rank_work *work, int others, double within_s);
void rank_end(rank_work *work);

#endif
