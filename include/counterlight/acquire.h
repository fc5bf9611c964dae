/* Acquisition: measuring the light transport through a rig. */
#ifndef COUNTERLIGHT_ACQUIRE_H
#define COUNTERLIGHT_ACQUIRE_H

#include <stdbool.h>

#include "counterlight/rig.h"
#include "counterlight/solve.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_progress {
  const char *phase;    /* "black", "flood", "level 3 of 6", "columns", "check" */
  long done, total;     /* patterns; total is an estimate that may grow */
  long resumed;         /* of those done: observed before an interruption */
  double seconds, left; /* since the start, and estimated until the end; left < 0 while not known */
} clt_progress;

typedef struct clt_acquire_options {
  const char *scheme; /* "brute", "hadamard", "hierarchical", "blocks" or "auto" (NULL: auto) */
  double threshold;   /* hierarchical: tau, the fraction of a cell's light under the flood below which the light of a
                         block that cannot be predicted is not resolved further; 0..0.5, 0 means 0.005 */
  double error;       /* wanted: relative RMS of the appearance of a picture, 0..0.5; 0 means 0.01. "blocks" stops where
                         it is reached, "auto" chooses by it */
  double seconds;     /* allowed, > 0, or 0 for any time: "blocks" stops there, "auto" chooses by it */
  int repeats;        /* observations averaged for black and flood, 1..256; 0 means 8, with "brute" N / 32 if more */
  int checks;         /* random check patterns observed at the end for provenance.error, 0..64 */
  unsigned seed;      /* of the check patterns */
  /* NULL, or a file in which every observation is kept as soon as it is made. Where it is there already, from an
   * acquisition that was interrupted, its observations are taken instead of new ones as long as the same patterns are
   * asked for. It stays: remove it when the transport is stored, or the next acquisition gives that one again.
   * CLT_BAD_INPUT where it is another rig's. What was observed earlier counts only where black, white and a random
   * picture, photographed again, are as they were; else all begins anew once they were not for patience_s. */
  const char *journal;
  const char *journal_of;   /* what a journal belongs to beside its rig, in words; may be NULL */
  double journal_age_s;     /* a dispensable journal that nothing was added to for longer is begun anew; 0: any age */
  bool journal_dispensable; /* one of another rig is begun anew as well, and where none can be kept the log says so
                               and the acquisition goes on. It outlives the process, not a power cut, and is given up
                               beyond 1 GiB */
  int watch;      /* patterns between two looks, 0..1000000: at what the patterns since the last one show together, and
                     at the white picture. Where the light of the patterns does not add up, or white is not as it was,
                     they are observed again once it is; all cells of a channel brighter or darker by one factor are a
                     lamp, by which observations are divided. A look follows at once where exposures of one pattern
                     contradict each other. Also waits for a device that is gone or gives no frame. 0: looks never and
                     waits for nothing; -1: every 25 patterns, and where what has to be kept in a temporary file to
                     observe only those again is more than 256 MiB and there is no journal, a disturbance is an error.
                     Patterns that never add up though their light is the same each time are a camera not in
                     proportion to light: provenance.plan says so */
  double watch_s; /* seconds of the devices' time after which a look is due as well; 0: patterns alone count */
  double patience_s; /* to wait for either, >= 0; 0 means 30. Then CLT_FAILED says where the room changed and by how
                        much, or the rig's own status says what is missing */
  bool recorded;     /* the devices are a recording: where it ends they are not waited for */
  bool reopens;      /* the caller opens devices again: one that is gone or gives no frame is CLT_GONE or CLT_TIMEOUT at
                        once, and the next acquisition goes on from the journal; only the room is waited for */
  /* Called after every pattern, and with phase "waiting" while a device is waited for; returning false cancels
   * (CLT_CANCELLED). May be NULL. */
  bool (*progress)(void *context, const clt_progress *progress);
  void *context;
} clt_acquire_options;

/* Measures T, black, flood and sigma. "brute" drives one cell at a time into a dense T, "hadamard" half of them (up to
 * 4096 cells). "hierarchical" splits blocks in four and drives those together whose light does not meet (Sen et al.
 * 2005; NUMERICS section 6) into a T over the pyramid's nodes (dense where the grid has at most 4096 cells). "blocks"
 * scans direct light and floods blocks of cells, whose light reciprocity completes, into a T in blocks storage. "auto"
 * takes the scheme that reaches the wanted error in the seconds allowed with the fewest patterns, or the one that comes
 * nearest. Rows are made consistent with the flood. The provenance is filled. */
CLT_PUBLIC clt_status clt_acquire(clt_rig *rig, const clt_acquire_options *options, clt_transport **out,
                                  clt_error *error);

/* Compensating one picture through the rig, without a transport. */
typedef struct clt_optical_options {
  double tolerance; /* relative residual over the cells free to follow, to stop at, below 1; 0 means 0.005. It also
                       stops where only the noise of a photograph is left */
  int photographs;  /* at most, all counted, 4..1000; 0 means 40 */
  clt_white white;  /* AUTO or VALUE; FEASIBLE needs a transport and is refused */
  bool (*progress)(void *context, const clt_progress *progress); /* as for clt_acquire; may be NULL */
  void *context;
} clt_optical_options;

enum { CLT_OPTICAL_CURVE_MAX = 64 };
/* Errors are relative RMS over lit cells, ||y - target|| / ||target||, as photographed. */
typedef struct clt_optical_result {
  int photographs, frames;        /* that it took: black, chessboard and its inverse, and one a step */
  double white[CLT_CHANNELS_MAX]; /* radiance that 1.0 in the picture stands for */
  double error_before;            /* drive = picture, after the best single brightness factor */
  double error_after;             /* of the drive that is returned, less the noise of its photograph */
  double noise;                   /* of one photograph, relative to the target */
  double clipped_fraction;        /* lit cells whose drive is at 0 or 1 */
  double seconds;                 /* wall time */
  bool converged;                 /* false where the photographs were used up first */
  char reason[96];                /* why it stopped */
  size_t curve_count;
  double curve[CLT_OPTICAL_CURVE_MAX]; /* ||y - target|| / ||target|| of each step's photograph */
} clt_optical_result;

/* The drive in 0..1 that makes `picture` (linear, the rig's grid and channels, values >= 0) appear, found by
 * photographs alone: T x is what the camera sees (O'Toole and Kutulakos 2010). Every photograph is of a drive in 0..1,
 * none is of a signed pattern. drive, the best that was photographed, is initialised here. Where a cell cannot reach
 * its target it stands at its bound, and the others reach theirs: not quite the least squares of "bounded". */
CLT_PUBLIC clt_status clt_optical_compensate(clt_rig *rig, const clt_image *picture, const clt_optical_options *options,
                                             clt_image *drive, clt_optical_result *result, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
