/* The bounded problem min ||S l - b||^2 / 2 over 0 <= l <= F, and the model that says where to go next. */
#ifndef CLT_SOLVE_BOUNDED_H
#define CLT_SOLVE_BOUNDED_H

#include "solve/method.h"

/* gradient g = -S' r with r = b - S l, or what a model says of it. The projected gradient l - P(l - g) is 0 exactly at
 * the optimum. */
typedef struct clt_box {
  clt_system *system;
  clt_run *run;
  double *light, *gradient, *direction,
      *curved;              /* cols values; light is l, always inside the box; curved is S' passed */
  double *residual, *image; /* rows values; image is S d */
  double *looked;           /* cols values: g when it was last looked up, -S' (r + passed) */
  double *passed;           /* rows values: what r has lost since */
  int unseen;               /* steps since */
  double objective;         /* ||r||^2 / 2 */
  double optimality;        /* ||l - P(l - g)|| */
  double target;            /* of the optimality */
} clt_box;

static inline double clt_box_top(const clt_box *box, size_t j) {
  return box->system->lit[j] ? box->system->first_bounce[j] : 0;
}
/* The nearest value in 0..F of cell j; dark cells have F = 0 here. */
static inline double clt_box_project(const clt_box *box, size_t j, double value) {
  double top = clt_box_top(box, j);
  return value < 0 ? 0 : value > top ? top : value;
}

enum { CLT_SECANTS = 20, CLT_SECANT_VECTORS = 2 * CLT_SECANTS + 4, CLT_SECANT_CELLS = 64 };

/* What the steps so far have shown of H = S' S: B = sigma (I - V (V'V)^-1 V') + Y Y' with Y = H V and V' Y = I, the
 * positive definite matrix that agrees with H on all of V (block BFGS; Schnabel 1983). */
typedef struct clt_secants {
  const clt_box *box;
  int count;
  double sigma;                                /* the curvature that is taken for granted elsewhere */
  double *v[CLT_SECANTS], *y[CLT_SECANTS];     /* cols values each, the oldest first */
  double *slope, *rest, *open;                 /* cols values: g + B d, a right side, and 1 where a cell is free */
  double *counted;                             /* cols values: 1 where a cell is in `whole` */
  double gram[CLT_SECANTS][CLT_SECANTS];       /* V' V */
  double whole[4 * CLT_SECANTS * CLT_SECANTS]; /* U'U over the counted cells, U = [V Y]; column-major, upper triangle */
  double small[4 * CLT_SECANTS * CLT_SECANTS], packed[2 * CLT_SECANTS * CLT_SECANT_CELLS];
} clt_secants;

/* What the products so far have shown of a reciprocal S (bounded_reciprocal.c). */
enum { CLT_RECIPROCAL_VECTORS = 2 * CLT_SECANTS + 3 };
typedef struct clt_reciprocal {
  const clt_box *box;
  int count, next;                       /* directions, and the place of the next */
  double *root;                          /* sqrt(w), cols values; 0 at dark cells */
  double *q, *y;                         /* CLT_SECANTS vectors of cols values, stride apart */
  double *fresh, *shown;                 /* cols values: a direction that comes in, and Z times it */
  double core[CLT_SECANTS][CLT_SECANTS]; /* Q'Y, made symmetric */
} clt_reciprocal;

/* An empty model; its CLT_RECIPROCAL_VECTORS vectors are those of the system from `first`. */
void clt_reciprocal_open(clt_reciprocal *model, const clt_box *box, size_t first);
/* Takes in S x = y. */
void clt_reciprocal_learn(clt_reciprocal *model, const double *x, const double *y);
/* Takes in S' p = s. */
void clt_reciprocal_learn_transposed(clt_reciprocal *model, const double *p, const double *s);
/* out = S' p as far as the model knows. */
void clt_reciprocal_guess(clt_reciprocal *model, const double *p, double *out);
/* Makes `secants` the model of S' S that follows. */
void clt_reciprocal_tell(clt_reciprocal *model, clt_secants *secants);

/* An empty model; its CLT_SECANT_VECTORS vectors are those of the system from `first`. */
void clt_secants_open(clt_secants *model, const clt_box *box, size_t first);
/* Takes in what a step along box->direction has shown: image = passed = S d and curved = H d. */
void clt_secants_learn(clt_secants *model);
/* Puts the d that minimises g'd + d'B d / 2 within the box into box->direction; false where the active set did not
 * settle. */
bool clt_secants_minimise(clt_secants *model);

#endif
