/* How fast each method gets there: the report's convergence curves. */
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "cli/demo.h"

/* Enough to tell the methods apart. */
static const clt_solve_options race_options = {.tolerance = 1e-5, .iteration_limit = 60};

/* The report's iteration, what tames it, the Krylov methods and the bounded solve; `counterlight tradeoff` compares
 * all.
 */
static const char *const racers[] = {"jacobi", "damped", "chebyshev", "pcg", "gmres", "bounded"};

/* target - b0, channel after channel. */
static void fill_wanted(const demo *d, double *wanted) {
  size_t cells = (size_t)d->grid.width * (size_t)d->grid.height;
  for (int c = 0; c < d->grid.channels; c++) {
    const float *black = clt_transport_black(d->transport, c);
    for (size_t i = 0; i < cells; i++) {
      wanted[(size_t)c * cells + i] = d->target.data[(size_t)c * cells + i] - black[i];
    }
  }
}

clt_status demo_race_methods(demo *d, clt_error *error) {
  size_t count = clt_image_size(&d->target);
  double *wanted = clt_alloc(2 * count, sizeof *wanted);
  if (!wanted) {
    return clt_fail(error, CLT_FAILED, "out of memory for %zu cells", count);
  }
  fill_wanted(d, wanted);
  for (size_t i = 0; i < sizeof racers / sizeof *racers; i++) {
    clt_solve_options options = race_options;
    clt_solve_result *run = &d->race.runs[d->race.count];
    options.method = racers[i];
    /* one that is refused or gives way to another has no curve of its own */
    if (clt_solve(d->transport, d->certificate, wanted, &options, wanted + count, run, NULL) == CLT_OK &&
        strcmp(run->method, racers[i]) == 0) {
      d->race.count++;
    }
  }
  free(wanted);
  return CLT_OK;
}
