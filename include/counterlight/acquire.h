/* Acquisition: measuring the light transport through a rig. */
#ifndef COUNTERLIGHT_ACQUIRE_H
#define COUNTERLIGHT_ACQUIRE_H

#include <stdbool.h>

#include "counterlight/rig.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_progress {
  const char *phase;    /* "black", "flood", "level 3 of 6", "columns", "check" */
  long done, total;     /* patterns; total is an estimate that may grow */
  double seconds, left; /* since the start, and estimated until the end; left < 0 while not known */
} clt_progress;

typedef struct clt_acquire_options {
  const char *scheme; /* "brute", "hierarchical" or "auto" (NULL: auto) */
  double threshold;   /* hierarchical: tau, the fraction of a cell's light under the flood below which the light of a
                         block that cannot be predicted is not resolved further; 0..0.5, 0 means 0.005 */
  int repeats;        /* observations averaged for black and flood, 1..256; 0 means 8, with "brute" N / 32 if more */
  int checks;         /* random check patterns observed at the end for provenance.error, 0..64 */
  unsigned seed;      /* of the check patterns */
  /* Called after every pattern; returning false cancels (CLT_CANCELLED). May be NULL. */
  bool (*progress)(void *context, const clt_progress *progress);
  void *context;
} clt_acquire_options;

/* Measures T, black, flood and sigma. "brute" drives one cell at a time into a dense T. "hierarchical" splits blocks in
 * four and drives those together whose light does not meet (Sen et al. 2005; NUMERICS section 6) into a T over the
 * pyramid's nodes (dense where the grid has at most 4096 cells). Rows are made consistent with the flood. The
 * provenance is filled. */
CLT_PUBLIC clt_status clt_acquire(clt_rig *rig, const clt_acquire_options *options, clt_transport **out,
                                  clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
