/* Which of the daemon's threads go first where there are more of them than processors, and how many processors each
 * takes. What shows a film is a row of stages that work at the same time: where each of them takes all processors, they
 * wait for each other in the middle of their work.
 *
 * All of it is asked of the system, which may refuse: then all threads are alike. */
#ifndef CLT_DAEMON_RANK_H
#define CLT_DAEMON_RANK_H

#include <sched.h>
#include <stdbool.h>

/* Steps of niceness between what stands on the glass, what is computed ahead of its time, and what is decoded ahead of
 * that or has no time at all (a new drive, what accuracy costs). */
enum { RANK_AHEAD = 5 };

/* Lets the calling thread, and those that it starts from now on, go behind the others by so many steps. */
void rank_behind(int steps);

/* How long a processor works on a thread before it looks at others. One that asks for little is served soon when it
 * wakes, if it has had no more than its share; one that asks for much is interrupted by those, and else left alone. */
typedef enum rank_turn { RANK_SOON, RANK_LONG } rank_turn;
void rank_take_turns(rank_turn turn);

/* The processors that the calling thread was given. */
typedef struct rank_place {
  cpu_set_t given;
  bool aside;
} rank_place;
rank_place rank_stand(void);
/* The thread that stands there, and those that it starts from now on, keep off the last of its processors, where it has
 * two or more: work that is done ahead of its time is not interrupted there. False undoes it. */
void rank_keep_aside(rank_place *place, bool aside);

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
