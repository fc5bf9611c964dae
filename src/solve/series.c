#include "solve/iterate.h"

static clt_status check(const clt_channel_certificate *channel, clt_error *error) {
  return clt_check_series("series", channel, error);
}

/* S_n^-1 b = sum over k <= n of (-1)^k R^k b   (Bai et al. 2010, eq. 16; the stratified inverses of Ng et al. 2009, who
 * keep T F^-1 in place of I + R). The term t_k = (-R)^k t_0 is made of the one before by a product, t_(k+1) = t_k - S
 * t_k, and is at the same time the residual of what was added so far: b - S (l + t_0 + ... + t_n) = t_(n+1) where t_0 =
 * b - S l. So the sum needs one product a term, as eq. 43 does, and equals its iterates, but rounding in a term stays
 * in all later ones: where the residual at the end is not what the terms told, a new series begins there. */
static clt_outcome run_series(clt_system *system, clt_run *run) {
  double *term = clt_system_vector(system, 0), *l = clt_system_vector(system, 1), *s = clt_system_vector(system, 2);
  clt_copy(system->cols, system->light, l);
  clt_watch watch = clt_watch_open(system, run, l, clt_system_residual(system, l, term), run->radius_high < 1);
  do {
    while (clt_watch_goes_on(&watch)) {
      clt_add(system->cols, 1, term, l);
      clt_system_apply(system, term, s);
      clt_add(system->cols, -1, s, term);
      clt_watch_count(&watch, clt_norm(system->cols, term));
    }
  } while (clt_watch_resumes(&watch, clt_system_residual(system, l, term)));
  return watch.outcome;
}

static void expect(clt_effort *effort) {
  clt_effort_richardson(effort, 1);
  clt_effort_take(effort, 3, 1, 3);
}

const clt_method clt_method_series = {
    .name = "series",
    .summary = "the inverse series b - R b + R R b - ... (eq. 16), the stratified inverses of Ng et al. 2009, term by "
               "term; converges where jacobi does, with the same iterates",
    .vectors = 3,
    .check = check,
    .expect = expect,
    .run = run_series,
};
