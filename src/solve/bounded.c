/* A projected quasi-Newton method for the box.
 *
 * Every step minimises a quadratic model within the box by an active set and goes towards that minimum as far as the
 * objective, itself quadratic, falls. The model agrees with S' S on every direction that was tried, so that the steps
 * gain as conjugate gradients on the final face do, and they change as much of the active set at once as they like
 * (Schmidt et al., "Optimizing costly functions with simple constraints", AISTATS 2009). Where the model's active set
 * does not settle, or steps have ceased to gain, a spectral projected gradient (Birgin, Martinez & Raydan, SIAM J.
 * Optim. 10, 2000) takes its place. Where S is reciprocal a model of S (bounded_reciprocal.c) tells the gradient of
 * most steps, which then take one product in place of two. All works on l = F x, in which S is well conditioned at
 * every albedo. */
#include "solve/bounded.h"

#include <math.h>

static const double TRUSTED = 1e-10;   /* of the optimality at x = 0: below this recurrences are recomputed */
static const double FALLS = 0.9;       /* a step that leaves more than this of the least optimality is stale */
static const double RECIPROCAL = 0.05; /* the reciprocity defect up to which a model of S saves products */
static const double MISLED = 0.5;  /* of the optimality seen last: more than this shows that the model of S is wrong */
static const double GAINED = 0.05; /* of the optimality seen last: where a model says less it is looked up */
static const double CERTAIN = 0.8; /* of the target: what a model must say for it to be reached */
enum { STALE_STEPS = 4, STALE_STEPS_MAX = 60, BOX_VECTORS = 7, UNSEEN_STEPS = 3 };

/* What is known of S: H = S'S, which says where to go, and S itself where it is reciprocal. */
typedef struct clt_models {
  bool reciprocal;
  clt_secants secants;
  clt_reciprocal transport;
} clt_models;

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

/* Where r and g belong to each other. */
static void start_from(clt_box *box) {
  clt_copy(box->system->cols, box->gradient, box->looked);
  memset(box->passed, 0, box->system->rows * sizeof(double));
  box->unseen = 0;
  measure(box);
}

/* r = b - S l and g = -S' r from scratch. */
static void refresh(clt_box *box) {
  clt_system_residual(box->system, box->light, box->residual);
  clt_system_apply_transposed(box->system, box->residual, box->gradient);
  cblas_dscal((blasint)box->system->cols, -1, box->gradient, 1);
  start_from(box);
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
  double **vectors[BOX_VECTORS] = {&box->gradient, &box->direction, &box->curved, &box->residual,
                                   &box->image,    &box->looked,    &box->passed};
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
    start_from(box);
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

/* Goes along d: with q = S d, f(l + a d) = f - a r'q + a^2 ||q||^2 / 2 has its least at a = r'q / ||q||^2, and the box
 * ends at a = 1. The steps since S' was last applied add up in `passed`. Returns the spectral length ||d||^2 / ||q||^2
 * of the next projected gradient. */
static double advance(clt_box *box) {
  clt_system *system = box->system;
  clt_system_apply(system, box->direction, box->image);
  double slope = clt_dot(system->rows, box->residual, box->image);
  double curvature = clt_dot(system->rows, box->image, box->image);
  double squared = clt_dot(system->cols, box->direction, box->direction);
  double length = curvature > 0 ? fmin(fmax(slope / curvature, 0), 1) : 1;
  cblas_dscal((blasint)system->cols, length, box->direction, 1);
  for (size_t j = 0; j < system->cols; j++) {
    box->light[j] = clt_box_project(box, j, box->light[j] + box->direction[j]);
  }
  clt_add(system->rows, -length, box->image, box->residual);
  clt_add(system->rows, length, box->image, box->passed);
  cblas_dscal((blasint)system->rows, length, box->image, 1);
  box->unseen++;
  return curvature > 0 ? fmin(fmax(squared / curvature, 1e-6), 1e6) : 1;
}

/* g by a product with S'; the step that led here teaches the models. */
static void look(clt_box *box, clt_models *models) {
  clt_system *system = box->system;
  clt_system_apply_transposed(system, box->passed, box->curved);
  clt_add(system->cols, 1, box->curved, box->looked);
  clt_copy(system->cols, box->looked, box->gradient);
  measure(box);
  if (models->reciprocal) {
    clt_reciprocal_learn_transposed(&models->transport, box->passed, box->curved);
  } else {
    clt_secants_learn(&models->secants);
  }
  memset(box->passed, 0, system->rows * sizeof(double));
  box->unseen = 0;
}

/* g as the model of a reciprocal S has it. */
static void guess(clt_box *box, clt_models *models) {
  clt_reciprocal_guess(&models->transport, box->passed, box->curved);
  for (size_t j = 0; j < box->system->cols; j++) {
    box->gradient[j] = box->looked[j] + box->curved[j];
  }
  measure(box);
}

/* The next direction, into box->direction; false where there is none down. */
static bool find_direction(clt_box *box, clt_models *models, bool model_gains, double lambda) {
  if (models->reciprocal && model_gains) {
    clt_reciprocal_tell(&models->transport, &models->secants);
  }
  if (model_gains && clt_secants_minimise(&models->secants) &&
      clt_dot(box->system->cols, box->gradient, box->direction) < 0) {
    for (size_t j = 0; j < box->system->cols; j++) {
      box->direction[j] = clt_box_project(box, j, box->light[j] + box->direction[j]) - box->light[j];
    }
    return true;
  }
  project_gradient(box, lambda);
  return clt_dot(box->system->cols, box->gradient, box->direction) < 0;
}

/* The certificate looked at the white picture and at what came of it: most of what R does is in them. */
static void open_models(clt_models *models, clt_box *box) {
  clt_system *system = box->system;
  models->reciprocal = system->square && system->flux != NULL && system->reciprocity <= RECIPROCAL;
  clt_secants_open(&models->secants, box, BOX_VECTORS);
  if (models->reciprocal) {
    clt_reciprocal_open(&models->transport, box, BOX_VECTORS + CLT_SECANT_VECTORS);
    clt_reciprocal_learn(&models->transport, system->first_bounce, system->flood);
    clt_reciprocal_learn(&models->transport, system->flood, system->reflood);
    clt_copy(system->cols, box->gradient, box->curved);
    cblas_dscal((blasint)system->cols, -1, box->curved, 1);
    clt_reciprocal_learn_transposed(&models->transport, box->residual, box->curved);
  }
}

/* Where S is not quite reciprocal the model of S contradicts itself sooner or later: that of H, which does not, starts
 * over. */
static void distrust(clt_models *models, const clt_box *box) {
  models->reciprocal = false;
  clt_secants_open(&models->secants, box, BOX_VECTORS);
}

/* After a step: g by the model while that sees more to gain, and by a product with S' where it does not, where it may
 * be wrong, and where there is no model of S. True where it was looked up. */
static bool follow(clt_box *box, clt_models *models, bool doubted, double seen) {
  if (models->reciprocal && box->unseen > 0) {
    clt_reciprocal_learn(&models->transport, box->direction, box->image);
  }
  if (models->reciprocal && !doubted && box->unseen < UNSEEN_STEPS) {
    guess(box, models);
    if (box->optimality > fmax(GAINED * seen, CERTAIN * box->target)) {
      return false;
    }
  }
  look(box, models);
  return true;
}

static clt_outcome run_bounded(clt_system *system, clt_run *run) {
  clt_box box;
  clt_models models;
  if (!open_box(&box, system, run)) {
    return CLT_RUN_CONVERGED;
  }
  open_models(&models, &box);
  double least = box.optimality, seen = least, lambda = 1;
  int stale = 0, looks = 0;
  bool settled = is_optimal(&box) || is_noise(&box);
  while (!settled && stale < STALE_STEPS_MAX && clt_run_may_go_on(run)) {
    bool down = find_direction(&box, &models, stale < STALE_STEPS || stale % 2 == 0, lambda), noise = is_noise(&box);
    if (!down && box.unseen == 0) {
      break;
    }
    if (down) {
      lambda = advance(&box);
      clt_run_count(run, residual_norm(&box));
    }
    if (follow(&box, &models, !down || stale > 0, seen)) {
      looks++;
      if (run->tolerance < TRUSTED ? stale > 0 || is_optimal(&box) : looks % CLT_SECANTS == 0) {
        refresh(&box);
      }
      if (models.reciprocal && box.optimality > MISLED * seen) {
        distrust(&models, &box);
      }
      stale = box.optimality < FALLS * least ? 0 : stale + 1;
      seen = box.optimality;
      least = fmin(least, seen);
      settled = is_optimal(&box);
    }
    /* a step that has only just come into the noise leaves more of the flat mode than the next one does */
    settled = settled || (noise && is_noise(&box));
  }
  return settled ? CLT_RUN_CONVERGED : CLT_RUN_STOPPED;
}

/* For a target that can be reached. Where S is reciprocal the steps gain as conjugate gradients do, and two in three go
 * without a product with S'; elsewhere they gain as conjugate gradients for the normal equations do. One that cannot be
 * reached takes the longer, the more cells end at a bound. */
static void expect(clt_effort *effort) {
  if (effort->channel->reciprocity <= RECIPROCAL) {
    clt_effort_krylov(effort, true);
    clt_effort_take(effort, 2, 1.4, 12 * CLT_SECANTS);
  } else {
    clt_effort_normal(effort);
    clt_effort_take(effort, 1, 2, 4 * CLT_SECANTS);
  }
}

const clt_method clt_method_bounded = {
    .name = "bounded",
    .summary =
        "the best drive within 0..1: projected quasi-Newton steps by active sets; slower, and up to twice as accurate "
        "as clamping where the room cannot reach the target",
    .bounded = true,
    .rectangular = true,
    .vectors = BOX_VECTORS + CLT_SECANT_VECTORS + CLT_RECIPROCAL_VECTORS,
    .expect = expect,
    .run = run_bounded,
};
