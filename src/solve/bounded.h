/* The bounded problem min ||S l - b||^2 / 2 over 0 <= l <= F, and what its two phases share. */
#ifndef CLT_SOLVE_BOUNDED_H
#define CLT_SOLVE_BOUNDED_H

#include "solve/method.h"

/* The share of the decrease that the slope promises with which a line search is content (Armijo). */
#define CLT_SUFFICIENT 1e-4

/* gradient g = -S' r with r = b - S l. The projected gradient l - P(l - g) is 0 exactly at the optimum. */
typedef struct clt_box {
  clt_system *system;
  clt_run *run;
  double *light, *gradient, *direction, *descent, *best; /* cols values; light is l, always inside the box */
  double *residual, *image, *rest;                       /* rows values */
  double objective;                                      /* ||r||^2 / 2 */
  double optimality;                                     /* ||l - P(l - g)|| */
  double target;                                         /* of the optimality */
} clt_box;

/* The nearest value in 0..F of cell j; dark cells have F = 0 here. */
static inline double clt_box_project(const clt_box *box, size_t j, double value) {
  double top = box->system->lit[j] ? box->system->first_bounce[j] : 0;
  return value < 0 ? 0 : value > top ? top : value;
}
/* Computes residual, objective, gradient and optimality of light from scratch. */
void clt_box_refresh(clt_box *box);
/* The same where residual is known already. */
void clt_box_refresh_gradient(clt_box *box);
bool clt_box_done(const clt_box *box); /* optimal, down in the noise, or told to stop */

/* Minimises over the face of cells that are not held at a bound by the gradient, then projects. `share` is the part of
 * the face's gradient that may be left. False where no projected point along the way is better. */
bool clt_box_search_face(clt_box *box, double share);

#endif
