/* A projected quasi-Newton method for the box.
 *
 * Every step minimises a quadratic model within the box by an active set and goes towards that minimum as far as the
 * objective, itself quadratic, falls. The model agrees with S' S on every direction that was tried, so that the steps
 * gain as conjugate gradients on the final face do, and they change as much of the active set at once as they like
 * (Schmidt et al., "Optimizing costly functions with simple constraints", AISTATS 2009). Where the model's active set
 * does not settle, or steps have ceased to gain, a spectral projected gradient (Birgin, Martinez & Raydan, SIAM J.
 * Optim. 10, 2000) takes its place. All works on l = F x, in which S is well conditioned at every albedo. */
#include "solve/bounded.h"

#include <math.h>

static const double TRUSTED = 1e-10; /* of the optimality at x = 0: below this recurrences are recomputed */
static const double FALLS = 0.9;     /* a step that leaves more than this of the least optimality is stale */
enum { STALE_STEPS = 4, STALE_STEPS_MAX = 60, BOX_VECTORS = 5 };

static double optimality(const clt_box *box, const double *light, const double *gradient) {
  double sum = 0;
  for (size_t j = 0; j < box->system->cols; j++) {
    double move = light[j] - clt_box_project(box, j, light[j] - gradient[j]);
    sum += move * move;
  }
  return sqrt(sum);
}

static double residual_norm(const clt_box *box) {
  return sqrt(2 * box->objective);
}

/* What r and g say of l. */
static void measure(clt_box *box) {
  box->objective = 0.5 * clt_dot(box->system->rows, box->residual, box->residual);
  box->optimality = optimality(box, box->light, box->gradient);
}

/* r = b - S l and g = -S' r from scratch. */
static void refresh(clt_box *box) {
  clt_system_residual(box->system, box->light, box->residual);
  clt_system_apply_transposed(box->system, box->residual, box->gradient);
  cblas_dscal((blasint)box->system->cols, -1, box->gradient, 1);
  measure(box);
}

static bool is_optimal(const clt_box *box) {
  return box->optimality <= box->target;
}

static bool is_noise(const clt_box *box) {
  return residual_norm(box) <= clt_run_noise(box->run, box->system);
}

/* False where x = 0 is the optimum and nothing is left to do. The target is relative to the projected gradient at
 * x = 0, where r = b and g = -S' b. */
static bool open_box(clt_box *box, clt_system *system, clt_run *run) {
  *box = (clt_box){.system = system, .run = run, .light = system->light};
  double **vectors[BOX_VECTORS] = {&box->gradient, &box->direction, &box->curved, &box->residual, &box->image};
  for (size_t i = 0; i < BOX_VECTORS; i++) {
    *vectors[i] = clt_system_vector(system, i);
  }
  clt_system_apply_transposed(system, system->wanted, box->gradient);
  bool warm = false;
  for (size_t j = 0; j < system->cols; j++) {
    box->direction[j] = clt_box_project(box, j, box->gradient[j]);
    box->light[j] = clt_box_project(box, j, box->light[j]);
    warm = warm || box->light[j] != 0;
  }
  double start = clt_system_least_norm(system, box->direction, system->cols);
  if (start == 0) {
    memset(system->light, 0, system->cols * sizeof(double));
    clt_run_open(run, system->wanted_norm);
    return false;
  }
  box->target = run->tolerance * start;
  if (warm) {
    refresh(box);
  } else {
    clt_copy(system->rows, system->wanted, box->residual);
    cblas_dscal((blasint)system->cols, -1, box->gradient, 1);
    measure(box);
  }
  clt_run_open(run, residual_norm(box));
  return true;
}

/* d = P(l - lambda g) - l */
static void project_gradient(clt_box *box, double lambda) {
  for (size_t j = 0; j < box->system->cols; j++) {
    box->direction[j] = clt_box_project(box, j, box->light[j] - lambda * box->gradient[j]) - box->light[j];
  }
}

/* Goes along d: with q = S d, f(l + a d) = f + a g'd + a^2 ||q||^2 / 2 has its least at a = -g'd / ||q||^2, and the box
 * ends at a = 1. Returns the spectral length ||d||^2 / ||q||^2 of the next projected gradient. */
static double advance(clt_box *box) {
  clt_system *system = box->system;
  clt_system_apply(system, box->direction, box->image);
  clt_system_apply_transposed(system, box->image, box->curved);
  double slope = clt_dot(system->cols, box->gradient, box->direction);
  double curvature = clt_dot(system->rows, box->image, box->image);
  double length = curvature > 0 ? fmin(-slope / curvature, 1) : 1;
  for (size_t j = 0; j < system->cols; j++) {
    box->light[j] = clt_box_project(box, j, box->light[j] + length * box->direction[j]);
  }
  clt_add(system->rows, -length, box->image, box->residual);
  clt_add(system->cols, length, box->curved, box->gradient);
  measure(box);
  double squared = clt_dot(system->cols, box->direction, box->direction);
  return curvature > 0 ? fmin(fmax(squared / curvature, 1e-6), 1e6) : 1;
}

/* The next direction, into box->direction; false where there is none down. */
static bool find_direction(clt_box *box, clt_secants *model, bool model_gains, double lambda) {
  if (model_gains && clt_secants_minimise(model) && clt_dot(box->system->cols, box->gradient, box->direction) < 0) {
    for (size_t j = 0; j < box->system->cols; j++) {
      box->direction[j] = clt_box_project(box, j, box->light[j] + box->direction[j]) - box->light[j];
    }
    return true;
  }
  project_gradient(box, lambda);
  return clt_dot(box->system->cols, box->gradient, box->direction) < 0;
}

static clt_outcome run_bounded(clt_system *system, clt_run *run) {
  clt_box box;
  clt_secants model;
  if (!open_box(&box, system, run)) {
    return CLT_RUN_CONVERGED;
  }
  clt_secants_open(&model, &box, BOX_VECTORS);
  double least = box.optimality, lambda = 1;
  int stale = 0;
  bool settled = is_optimal(&box) || is_noise(&box);
  while (!settled && stale < STALE_STEPS_MAX && clt_run_may_go_on(run)) {
    if (!find_direction(&box, &model, stale < STALE_STEPS || stale % 2 == 0, lambda)) {
      break;
    }
    bool noise = is_noise(&box);
    lambda = advance(&box);
    clt_secants_learn(&model);
    clt_run_count(run, residual_norm(&box));
    if (run->tolerance < TRUSTED ? stale > 0 || is_optimal(&box) : run->iterations % CLT_SECANTS == 0) {
      refresh(&box);
    }
    stale = box.optimality < FALLS * least ? 0 : stale + 1;
    least = fmin(least, box.optimality);
    /* a step that has only just come into the noise leaves more of the flat mode than the next one does */
    settled = is_optimal(&box) || (noise && is_noise(&box));
  }
  return settled ? CLT_RUN_CONVERGED : CLT_RUN_STOPPED;
}

/* For a target that can be reached: steps of two products that gain as conjugate gradients for the normal equations do.
 * A target that cannot be reached takes the longer, the more cells end at a bound. */
static void expect(clt_effort *effort) {
  clt_effort_normal(effort);
  clt_effort_take(effort, 1, 2, 4 * CLT_SECANTS);
}

const clt_method clt_method_bounded = {
    .name = "bounded",
    .summary =
        "the best drive within 0..1: projected quasi-Newton steps by active sets; slower, and up to twice as accurate "
        "as clamping where the room cannot reach the target",
    .bounded = true,
    .rectangular = true,
    .vectors = BOX_VECTORS + CLT_SECANT_VECTORS,
    .expect = expect,
    .run = run_bounded,
};
