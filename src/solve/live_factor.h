/* The matrix of a Newton step (live_far.h) and its factors, by LU with pivots. What the matrix needs of the cells is
 * counted leaf by leaf, so that one taken anew costs what the leaves do where that has changed. */
#ifndef CLT_SOLVE_LIVE_FACTOR_H
#define CLT_SOLVE_LIVE_FACTOR_H

#include "solve/live_far.h"

/* Finds how much of the rank is to be coupled, and takes the factors of no held cell. Items must have their constants.
 */
clt_status clt_factor_create(clt_far *far, clt_error *error);
void clt_factor_destroy(clt_far *far);

/* Takes the factors of the wanted channels from what their items hold now; false where one is singular. */
bool clt_factor_renew(clt_far *far, const bool wanted[CLT_CHANNELS_MAX]);

/* answer = the channel's matrix^-1 answer: twice as many values as columns are coupled. */
void clt_factor_solve(const clt_far *far, int channel, float *answer);

#endif
