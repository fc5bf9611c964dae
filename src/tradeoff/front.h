/* Which points of a tradeoff count, which one is recommended, and the sentence that says so. */
#ifndef CLT_TRADEOFF_FRONT_H
#define CLT_TRADEOFF_FRONT_H

#include "counterlight/tradeoff.h"

/* Marks the front: the points that no other beats in both time and error (one of equals). */
clt_status clt_front_mark(clt_tradeoff *tradeoff, clt_error *error);
/* The points of the front by rising time; room for `count`. Returns how many. */
size_t clt_front_list(const clt_tradeoff *tradeoff, size_t *order);
/* Chooses a point of the front and writes the sentence; the front is marked and not empty. */
clt_status clt_front_tell(clt_tradeoff *tradeoff, const clt_tradeoff_options *options, clt_error *error);

/* "2.1 ms", "1.5 s" */
void clt_front_time(double seconds, char text[24]);
/* "0.3 %" */
void clt_front_share(double share, char text[24]);

#endif
