/* What each pass over a hierarchy takes by itself. */
#include "base/clock.h"
#include "solve/live_far.h"

static double time_kernel(clt_far *far, clt_live_pass_name name, float *next) {
  const int64_t since_ns = clt_clock_ns();
  clt_turns turns = clt_live_turns(far);
#pragma omp parallel if (far->shared)
  for (clt_live_item *item, *end; clt_live_next(far, &turns, &item, &end);) {
    for (; item < end; item++) {
      if (name == CLT_LIVE_PASS_AIM) {
        far->kernels->aim(far, item);
      } else if (name == CLT_LIVE_PASS_MOVE) {
        far->kernels->move(far, item, next);
      } else if (name == CLT_LIVE_PASS_LIGHT) {
        clt_newton_light(far, item);
      } else {
        far->kernels->look(far, item);
      }
    }
  }
  return clt_clock_since(since_ns);
}

static double time_gather(clt_far *far) {
  const int64_t since_ns = clt_clock_ns();
#pragma omp parallel if (far->shared)
  clt_newton_gather(far);
  return clt_clock_since(since_ns);
}

bool clt_live_time_passes(clt_live *live, const float *target, clt_live_pass pass[CLT_LIVE_PASSES]) {
  if (live->form != &clt_live_hierarchic) {
    return false;
  }
  clt_far *far = live->own;
  const double channels = far->channels, plane = channels * (double)far->cells * sizeof(float);
  const double shown = (double)far->strips * CLT_LIVE_LANES * sizeof(float);
  const double scale = far->scale != NULL ? (double)far->strips * CLT_LIVE_LANES * sizeof *far->scale : 0;
  const double constant = (double)far->strips * sizeof *far->strip + scale;
  const double spill = (double)far->blocks * CLT_LIVE_LANES * sizeof *far->spill + (double)far->codes;
  const clt_hierarchy_storage *of = far->hierarchy;
  const double times = channels / (double)of->left.sets, core = of->core != NULL ? (double)(far->rank * far->rank) : 0;
  const double give = times * (double)clt_leaf_rows_bytes(&of->right) + channels * core * sizeof(float);
  const double take = times * (double)clt_leaf_rows_bytes(&of->left);
  far->target = target;
  pass[CLT_LIVE_PASS_AIM] = (clt_live_pass){"frame: aim", constant + shown + 2 * plane, 0};
  pass[CLT_LIVE_PASS_MOVE] = (clt_live_pass){"frame: move", constant + shown + 3 * plane, 0};
  pass[CLT_LIVE_PASS_GATHER] = (clt_live_pass){"frame: gather", give, 0};
  pass[CLT_LIVE_PASS_LIGHT] = (clt_live_pass){"frame: light", take, 0};
  pass[CLT_LIVE_PASS_LOOK] = (clt_live_pass){"frame: look", constant + shown + 2 * plane + spill, 0};
  for (clt_live_pass_name name = CLT_LIVE_PASS_AIM; name < CLT_LIVE_PASSES; name++) {
    pass[name].seconds =
        name == CLT_LIVE_PASS_GATHER ? time_gather(far) : time_kernel(far, name, far->drive[(far->now + 1) % 3]);
  }
  live->form->reset(live);
  return true;
}
