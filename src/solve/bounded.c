/* Spectral projected gradients find the face of the box, an active set finishes on it.
 *
 * Birgin, Martinez, Raydan, "Nonmonotone spectral projected gradient methods on convex sets", SIAM J. Optim. 10 (2000);
 * the alternation with conjugate gradients on the face follows More & Toraldo, SIAM J. Optim. 1 (1991). Both work on
 * l = F x, in which S is well conditioned at every albedo. */
#include "solve/bounded.h"

#include <math.h>

enum { MEMORY = 10, FIRST_STEPS = 12, LATER_STEPS = 4, STALE_CYCLES = 6, START_ITERATIONS = 100 };
static const double START_TOLERANCE = 1e-3; /* of the unbounded solution that is clipped for a start */

static double optimality(const clt_box *box, const double *light, const double *gradient) {
  double sum = 0;
  for (size_t j = 0; j < box->system->cols; j++) {
    double move = light[j] - clt_box_project(box, j, light[j] - gradient[j]);
    sum += move * move;
  }
  return sqrt(sum);
}

void clt_box_refresh_gradient(clt_box *box) {
  clt_system *system = box->system;
  clt_system_apply_transposed(system, box->residual, box->gradient);
  for (size_t j = 0; j < system->cols; j++) {
    box->gradient[j] = -box->gradient[j];
  }
  box->objective = 0.5 * clt_dot(system->rows, box->residual, box->residual);
  box->optimality = optimality(box, box->light, box->gradient);
}

void clt_box_refresh(clt_box *box) {
  clt_system_residual(box->system, box->light, box->residual);
  clt_box_refresh_gradient(box);
}

static double residual_norm(const clt_box *box) {
  return sqrt(2 * box->objective);
}

/* Optimal, or no further from the target than noise is. */
static bool is_reached(const clt_box *box) {
  return box->optimality <= box->target || residual_norm(box) <= clt_run_noise(box->run, box->system);
}

bool clt_box_done(const clt_box *box) {
  return is_reached(box) || !clt_run_may_go_on(box->run);
}

/* One spectral step. With d = P(l - lambda g) - l and q = S d the objective along d is known exactly,
 * f(l + a d) = f + a g'd + a^2 ||q||^2 / 2, so the line search costs no product: the full step where it stays below the
 * greatest of the remembered objectives, else the minimiser a = -g'd / ||q||^2. Returns the next spectral length
 * ||d||^2 / ||q||^2, or 0 where d is no descent. */
static double spectral_step(clt_box *box, double lambda, double greatest) {
  clt_system *system = box->system;
  for (size_t j = 0; j < system->cols; j++) {
    double moved = clt_box_project(box, j, box->light[j] - lambda * box->gradient[j]);
    box->direction[j] = moved - box->light[j];
  }
  double slope = clt_dot(system->cols, box->gradient, box->direction);
  if (!(slope < 0)) {
    return 0;
  }
  clt_system_apply(system, box->direction, box->image);
  double curvature = clt_dot(system->rows, box->image, box->image), length = 1;
  if (slope + curvature / 2 > greatest - box->objective + CLT_SUFFICIENT * slope) {
    length = -slope / curvature;
  }
  for (size_t j = 0; j < system->cols; j++) {
    box->light[j] = clt_box_project(box, j, box->light[j] + length * box->direction[j]);
  }
  clt_add(system->rows, -length, box->image, box->residual);
  clt_box_refresh_gradient(box);
  double squared = clt_dot(system->cols, box->direction, box->direction);
  return curvature > 0 ? fmin(fmax(squared / curvature, 1e-6), 1e6) : 1;
}

/* Spectral steps; ends at the best point that it met. */
static void search_box(clt_box *box, int steps) {
  double remembered[MEMORY], lambda = 1, least = box->objective;
  for (int i = 0; i < MEMORY; i++) {
    remembered[i] = box->objective;
  }
  clt_copy(box->system->cols, box->light, box->best);
  for (int step = 0; step < steps && !clt_box_done(box); step++) {
    double greatest = 0;
    for (int i = 0; i < MEMORY; i++) {
      greatest = fmax(greatest, remembered[i]);
    }
    lambda = spectral_step(box, lambda, greatest);
    if (lambda == 0) {
      break;
    }
    remembered[step % MEMORY] = box->objective;
    clt_run_count(box->run, residual_norm(box));
    if (box->objective < least) {
      least = box->objective;
      clt_copy(box->system->cols, box->light, box->best);
    }
  }
  if (box->objective > least) {
    clt_copy(box->system->cols, box->best, box->light);
    clt_box_refresh(box);
  }
}

static void clip(const clt_box *box, double *light) {
  for (size_t j = 0; j < box->system->cols; j++) {
    light[j] = clt_box_project(box, j, light[j]);
  }
}

static double clipped_residual(clt_box *box, double *light) {
  clip(box, light);
  return clt_system_residual(box->system, light, box->residual);
}

/* The start: the given light or the clamped unbounded solution, whichever leaves the lesser residual, so that the
 * answer is never worse than clamping. The Krylov method's vectors lie where `light` and the others of the box do, so
 * it runs before the box is made. */
static void choose_start(clt_system *system, clt_run *run) {
  clt_run unbounded = *run;
  unbounded.tolerance = START_TOLERANCE;
  if (run->iteration_limit - run->iterations > START_ITERATIONS) {
    unbounded.iteration_limit = run->iterations + START_ITERATIONS;
  }
  clt_box box = {.system = system, .residual = clt_system_vector(system, CLT_GMRES_VECTORS + 1)};
  double *given = clt_system_vector(system, CLT_GMRES_VECTORS + 2);
  clt_copy(system->cols, system->light, given);
  double residual = clipped_residual(&box, given);
  if (system->square) {
    clt_method_linear(system->reciprocity)->run(system, &unbounded);
    run->iterations = unbounded.iterations;
    if (clipped_residual(&box, system->light) <= residual) {
      return;
    }
  }
  clt_copy(system->cols, given, system->light);
}

/* False where x = 0 is the optimum and nothing is left to do. */
static bool open_box(clt_box *box, clt_system *system, clt_run *run) {
  *box = (clt_box){.system = system, .run = run, .light = system->light};
  double **vectors[] = {&box->gradient, &box->direction, &box->descent, &box->best,
                        &box->residual, &box->image,     &box->rest};
  for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; i++) {
    *vectors[i] = clt_system_vector(system, i);
  }
  /* the target is relative to the projected gradient at x = 0, where r = b and g = -S' b */
  clt_system_apply_transposed(system, system->wanted, box->gradient);
  for (size_t j = 0; j < system->cols; j++) {
    box->direction[j] = clt_box_project(box, j, box->gradient[j]);
  }
  double start = clt_system_least_norm(system, box->direction, system->cols);
  if (start == 0) {
    memset(system->light, 0, system->cols * sizeof(double));
    clt_run_open(run, system->wanted_norm);
    return false;
  }
  box->target = run->tolerance * start;
  clt_box_refresh(box);
  clt_run_open(run, residual_norm(box));
  return true;
}

static clt_outcome run_bounded(clt_system *system, clt_run *run) {
  clt_box box;
  choose_start(system, run);
  if (!open_box(&box, system, run)) {
    return CLT_RUN_CONVERGED;
  }
  double least = box.optimality;
  int stale = 0;
  search_box(&box, FIRST_STEPS);
  while (!clt_box_done(&box) && stale < STALE_CYCLES) {
    double before = box.objective;
    /* a face that is still changing is not worth a precise answer */
    bool moved = clt_box_search_face(&box, fmax(0.1 * box.target / box.optimality, stale > 0 ? 1e-4 : 0.05));
    if (!clt_box_done(&box)) {
      search_box(&box, moved ? LATER_STEPS : FIRST_STEPS);
    }
    bool better = box.optimality < 0.9 * least || box.objective < before * (1 - 1e-12);
    stale = better ? 0 : stale + 1;
    least = fmin(least, box.optimality);
  }
  return is_reached(&box) ? CLT_RUN_CONVERGED : CLT_RUN_STOPPED;
}

const clt_method clt_method_bounded = {
    .name = "bounded",
    .summary =
        "the best drive within 0..1: spectral projected gradients, then an active set; slower, and up to twice as "
        "accurate as clamping where the room cannot reach the target",
    .bounded = true,
    .rectangular = true,
    .vectors = CLT_GMRES_VECTORS + 3,
    .run = run_bounded,
};
