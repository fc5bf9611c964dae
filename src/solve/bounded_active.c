/* The active-set phase of the bounded solve. */
#include <math.h>

#include "solve/bounded.h"

enum { FACE_STEPS = 60, HALVINGS = 8 };

/* A cell is held where it lies at a bound and the descent direction -g points out of the box. */
static bool is_free(const clt_box *box, size_t j) {
  double light = box->light[j], gradient = box->gradient[j];
  return box->system->lit[j] && !(light <= 0 && gradient >= 0) &&
         !(light >= box->system->first_bounce[j] && gradient <= 0);
}

/* values = S' rest on the free cells, 0 on the held ones; returns its squared norm. */
static double free_gradient(clt_box *box, double *values) {
  clt_system_apply_transposed(box->system, box->rest, values);
  for (size_t j = 0; j < box->system->cols; j++) {
    values[j] = is_free(box, j) ? values[j] : 0;
  }
  return clt_dot(box->system->cols, values, values);
}

/* CGLS (Hestenes & Stiefel 1952) for min ||r - S d|| over d on the free cells; d goes to box->descent. */
static void solve_face(clt_box *box, double share) {
  clt_system *system = box->system;
  double *d = box->descent, *p = box->direction, *s = box->best, *q = box->image;
  memset(d, 0, system->cols * sizeof *d);
  clt_copy(system->rows, box->residual, box->rest);
  double gamma = free_gradient(box, p), enough = share * share * gamma;
  for (int step = 0; step < FACE_STEPS && gamma > enough && clt_run_may_go_on(box->run); step++) {
    clt_system_apply(system, p, q); /* q = S p */
    double curvature = clt_dot(system->rows, q, q);
    if (!(curvature > 0)) {
      return;
    }
    clt_add(system->cols, gamma / curvature, p, d);
    clt_add(system->rows, -gamma / curvature, q, box->rest);
    double next = free_gradient(box, s);
    for (size_t j = 0; j < system->cols; j++) {
      p[j] = s[j] + next / gamma * p[j];
    }
    gamma = next;
    clt_run_count(box->run, sqrt(2 * box->objective)); /* l has not moved yet */
  }
}

bool clt_box_search_face(clt_box *box, double share) {
  clt_system *system = box->system;
  double *trial = box->best, *change = box->direction, *image = box->image;
  solve_face(box, share);
  double length = 1;
  for (int halving = 0; halving <= HALVINGS; halving++, length /= 2) {
    for (size_t j = 0; j < system->cols; j++) {
      trial[j] = clt_box_project(box, j, box->light[j] + length * box->descent[j]);
      change[j] = trial[j] - box->light[j];
    }
    double slope = clt_dot(system->cols, box->gradient, change);
    if (!(slope < 0)) {
      continue;
    }
    /* f(l + c) - f(l) = g'c + ||S c||^2 / 2, free of the cancellation in f itself */
    clt_system_apply(system, change, image);
    if (slope + 0.5 * clt_dot(system->rows, image, image) <= CLT_SUFFICIENT * slope) {
      clt_copy(system->cols, trial, box->light);
      clt_add(system->rows, -1, image, box->residual);
      clt_box_refresh_gradient(box);
      return true;
    }
  }
  return false;
}
