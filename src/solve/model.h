/* A small copy of S on which methods are tried out at no cost, and what a method then expects of a solve.
 *
 * Arnoldi's k steps from a picture-like b give V with orthonormal columns, v_0 = b / ||b||, and S V = V H + beyond. For
 * every polynomial p of degree below k, p(S) b = V p(H) e_0 ||b|| exactly; beyond that degree the Ritz values of H,
 * which have found the ends of the spectrum, go on telling how the residual falls (Golub & Meurant, Matrices, Moments
 * and Quadrature, 2010). So a method that takes products is run on H x = e_0 in place of S l = b. */
#ifndef CLT_SOLVE_MODEL_H
#define CLT_SOLVE_MODEL_H

#include "counterlight/solve.h"
#include "solve/system.h"

enum { CLT_MODEL_STEPS = 16, CLT_MODEL_VECTORS = CLT_MODEL_STEPS + 1 };

typedef struct clt_model {
  size_t cells; /* lit ones */
  int steps;    /* k; 0 where rows != cols or nothing is lit */
  double h[CLT_MODEL_STEPS + 1][CLT_MODEL_STEPS];
  double product_s; /* wall time of a product of the channel with T */
  double vector_s;  /* of y += a x over its cells */
} clt_model;

/* Fills the model of the selected channel; needs CLT_MODEL_VECTORS reserved. */
void clt_model_build(clt_system *system, clt_model *model);

/* One channel's solve as a method expects it. */
typedef struct clt_effort {
  const clt_model *model;
  const clt_channel_certificate *channel;
  double tolerance;
  int limit; /* of iterations */

  int iterations;
  double residual;    /* ||b - S l|| / ||b|| after them */
  double start_s;     /* wall time before the first iteration and after the last */
  double iteration_s; /* of one */
  double prepare_s;   /* of what the method makes ready before any solve */
} clt_effort;

/* Runs l <- l + omega (e_0 - H l) on the model; iterations and residual. */
void clt_effort_richardson(clt_effort *effort, double omega);
/* Chebyshev's iteration on the model for eigenvalues within theta +- delta, m = delta / theta. */
void clt_effort_chebyshev(clt_effort *effort, double m);
/* The Krylov methods: residuals of conjugate gradients (the Galerkin condition), or the least ones. */
void clt_effort_krylov(clt_effort *effort, bool least);
/* Conjugate gradients for the normal equations. */
void clt_effort_normal(clt_effort *effort);
/* Sweeps of relaxation, in order or the largest residual first, over a box whose six faces light each other evenly and
 * whose rho(R) is that of the channel. */
void clt_effort_sweeps(clt_effort *effort, double omega, bool largest_first);
/* A method that makes the residual `factor` times smaller an iteration. */
void clt_effort_steady(clt_effort *effort, double factor);
/* start_s of so many products, iteration_s of so many products and vector operations. */
void clt_effort_take(clt_effort *effort, double start_products, double products, double vectors);
/* What taking the entries of S and then `flops` operations costs; adds to prepare_s. */
void clt_effort_prepare(clt_effort *effort, double flops);

#endif
