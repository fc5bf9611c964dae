/* Which of the daemon's threads go first where there are more of them than processors, and how many processors each
 * takes. What shows a film is a row of stages that work at the same time: where each of them takes all processors, they
 * wait for each other in the middle of their work. */
#ifndef CLT_DAEMON_RANK_H
#define CLT_DAEMON_RANK_H

/* Steps of niceness between what stands on the glass, what is computed ahead of its time, and what is decoded ahead of
 * that or has no time at all (a new drive, what accuracy costs). */
enum { RANK_AHEAD = 5 };

/* Lets the calling thread, and those that it starts from now on, go behind the others by so many steps. */
void rank_behind(int steps);
/* How many threads the loops of the calling thread have from now on, 1 at least. */
void rank_share(int threads);
/* How many they have at present. */
int rank_threads(void);

#endif
