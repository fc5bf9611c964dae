/* Compensation without T: the room itself makes the products (O'Toole and Kutulakos 2010).
 *
 * With b the wanted light less the black, S l = b is solved for l = F x by GMRES in the form of Anderson's acceleration
 * (Walker and Ni 2011), which needs no signed patterns: every photograph is of a drive in 0..1,
 *   r_k = b - T x_k,   x' = sum g_k x_k,   r' = sum g_k r_k,   x_(k+1) = clip(x' + F^-1 r'),
 * with the affine combination g of the pairs kept (sum g = 1) that makes r' least; since T is linear, r' is the
 * residual of x' without a photograph. Cells that stand at a bound and would have to go beyond take no part in r'. F
 * comes from two photographs of a chessboard of cells and its inverse, whose difference is direct light (Nayar et al.
 * 2006). */
#include <lapacke.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "acquire/session.h"
#include "base/memory.h"
#include "base/order.h"

enum { KEPT = 12, PHOTOGRAPHS_DEFAULT = 40, PHOTOGRAPHS_MAX = 1000, PREPARING = 3, PATIENCE = 2 };
#define TOLERANCE_DEFAULT 0.005
#define SAFETY 1.05  /* discrepancy principle: stop at this many times the noise */
#define STALLED 0.96 /* of the best squared residual: more than that is no progress */
#define DARK_SHARE 1e-3
#define DARK_SIGMAS 5.0
#define RIDGE 1e-9 /* of the trace: pairs that hardly differ */

typedef struct optical {
  clt_session session;
  size_t cells, values;
  int channels, limit, pairs, newest;
  double tolerance;
  float *first_bounce, *wanted, *flood; /* F (0: dark), b, T 1 */
  float *drive[KEPT], *residual[KEPT];
  unsigned char *free;
  clt_image best;
  double best_norm;
} optical;

static clt_status check_options(const clt_optical_options *options, clt_error *error) {
  if (!(options->tolerance >= 0 && options->tolerance < 1) || options->photographs < 0 ||
      (options->photographs > 0 && options->photographs <= PREPARING) || options->photographs > PHOTOGRAPHS_MAX) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "tolerance %g, %d photographs; legal are 0 (the default) to below 1, and 0 (the default) or %d to %d",
        options->tolerance, options->photographs, PREPARING + 1, PHOTOGRAPHS_MAX);
  }
  if (options->white.kind == CLT_WHITE_FEASIBLE) {
    return clt_fail(error, CLT_BAD_INPUT, "white \"feasible\" needs a measured transport; give auto or a radiance");
  }
  return CLT_OK;
}

static clt_status init(optical *own, clt_rig *rig, const clt_optical_options *options, clt_error *error) {
  const clt_acquire_options acquire = {.repeats = 1, .progress = options->progress, .context = options->context};
  *own = (optical){.limit = options->photographs > 0 ? options->photographs : PHOTOGRAPHS_DEFAULT,
                   .tolerance = options->tolerance > 0 ? options->tolerance : TOLERANCE_DEFAULT,
                   .best_norm = INFINITY};
  clt_status status = clt_session_init(&own->session, rig, &acquire, error);
  if (status != CLT_OK) {
    return status;
  }
  const clt_rig_info *info = &own->session.info;
  own->cells = own->session.cells;
  own->channels = info->channels;
  own->values = own->cells * (size_t)info->channels;
  own->session.progress.total = own->limit;
  float **const arrays[] = {&own->first_bounce, &own->wanted, &own->flood};
  bool room = (own->free = clt_alloc(own->values, 1)) != NULL;
  for (size_t k = 0; k < sizeof arrays / sizeof arrays[0]; k++) {
    room = (*arrays[k] = clt_alloc(own->values, sizeof(float))) != NULL && room;
  }
  for (int k = 0; k < KEPT; k++) {
    own->drive[k] = clt_alloc(own->values, sizeof(float));
    own->residual[k] = clt_alloc(own->values, sizeof(float));
    room = room && own->drive[k] != NULL && own->residual[k] != NULL;
  }
  return room ? clt_image_init(&own->best, info->channels, info->height, info->width, error)
              : clt_fail(error, CLT_FAILED, "out of memory for an optical solve of %zu cells", own->cells);
}

static void finish(optical *own) {
  clt_session_finish(&own->session);
  clt_image_finish(&own->best);
  free(own->first_bounce);
  free(own->wanted);
  free(own->flood);
  free(own->free);
  for (int k = 0; k < KEPT; k++) {
    free(own->drive[k]);
    free(own->residual[k]);
  }
}

static void light_chessboard(clt_session *session, int parity) {
  clt_image *drive = &session->drive;
  for (size_t at = 0; at < clt_image_size(drive); at++) {
    size_t x = at % (size_t)drive->width, y = at / (size_t)drive->width % (size_t)drive->height;
    drive->data[at] = (x + y) % 2 == (size_t)parity ? 1 : 0;
  }
}

/* F where direct light stands out, else 0: a cell that its row cannot drive. */
static void find_dark(optical *own, const float *variance) {
  for (int c = 0; c < own->channels; c++) {
    float *direct = own->first_bounce + (size_t)c * own->cells, brightest = 0;
    for (size_t i = 0; i < own->cells; i++) {
      const bool seen = isfinite(variance[(size_t)c * own->cells + i]);
      direct[i] = seen ? direct[i] : 0;
      brightest = direct[i] > brightest ? direct[i] : brightest;
    }
    for (size_t i = 0; i < own->cells; i++) {
      const double deviation = sqrt((double)variance[(size_t)c * own->cells + i]);
      const double least = fmax(DARK_SHARE * (double)brightest, DARK_SIGMAS * deviation);
      direct[i] = (double)direct[i] > least ? direct[i] : 0;
    }
  }
}

/* Black, chessboard and its inverse: b0, F and the flood. */
static clt_status prepare(optical *own, clt_error *error) {
  clt_session *session = &own->session;
  clt_session_fill(session, 0);
  clt_status status = clt_session_average(session, "black", &session->black, &session->black_variance, error);
  float *variance = session->flood_variance.data;
  for (int parity = 0; status == CLT_OK && parity < 2; parity++) {
    light_chessboard(session, parity);
    status = clt_session_observe(session, "chessboard", error);
    for (size_t at = 0; status == CLT_OK && at < own->values; at++) {
      const float light = session->seen.data[at], deviation = session->deviation.data[at];
      own->first_bounce[at] += session->drive.data[at] > 0 ? light : -light;
      own->flood[at] += light - session->black.data[at];
      variance[at] += deviation * deviation;
    }
  }
  if (status == CLT_OK) {
    find_dark(own, variance);
  }
  return status;
}

/* b = white * picture - b0, white by default the median F of lit cells. */
static clt_status find_wanted(optical *own, const clt_image *picture, const clt_white *white, double *values,
                              clt_error *error) {
  for (int c = 0; c < own->channels; c++) {
    const size_t first = (size_t)c * own->cells;
    float *sorted = own->residual[0];
    size_t lit = 0;
    for (size_t i = 0; i < own->cells; i++) {
      if (own->first_bounce[first + i] > 0) {
        sorted[lit++] = own->first_bounce[first + i];
      }
    }
    if (lit == 0) {
      return clt_fail(
          error, CLT_FAILED,
          "the camera sees no direct light of the projector in channel %d; check the projector, the lens cap "
          "and the exposures",
          c + 1);
    }
    clt_sort_floats(sorted, lit);
    values[c] = white->kind == CLT_WHITE_VALUE ? white->value : (double)sorted[lit / 2];
    for (size_t i = 0; i < own->cells; i++) {
      own->wanted[first + i] = (float)values[c] * picture->data[first + i] - own->session.black.data[first + i];
    }
  }
  return CLT_OK;
}

static float clip(double value) {
  return (float)fmin(fmax(value, 0), 1);
}

/* Norms over lit cells: ||r|| with its noise, of free cells alone, and ||target||. */
typedef struct norms {
  double residual, noise, free, free_noise, target;
} norms;

/* Photographs session.drive, keeps the pair and marks the cells that are free to go where they should. */
static clt_status photograph(optical *own, norms *found, clt_error *error) {
  clt_session *session = &own->session;
  clt_status status = clt_session_observe(session, "solving", error);
  if (status != CLT_OK) {
    return status;
  }
  own->newest = own->pairs % KEPT;
  own->pairs++;
  float *drive = own->drive[own->newest], *residual = own->residual[own->newest];
  memcpy(drive, session->drive.data, own->values * sizeof *drive);
  *found = (norms){0};
  for (size_t at = 0; at < own->values; at++) {
    const double deviation = (double)session->deviation.data[at];
    const bool counts = own->first_bounce[at] > 0 && isfinite(deviation);
    const double black = (double)session->black.data[at], target = (double)own->wanted[at] + black;
    const double r = counts ? target - (double)session->seen.data[at] : 0;
    own->free[at] = counts && !(drive[at] <= 0 && r < 0) && !(drive[at] >= 1 && r > 0);
    residual[at] = (float)r;
    found->residual += r * r;
    found->free += own->free[at] ? r * r : 0;
    found->noise += counts ? deviation * deviation : 0;
    found->free_noise += own->free[at] ? deviation * deviation : 0;
    found->target += counts ? target * target : 0;
  }
  if (found->residual < own->best_norm) {
    own->best_norm = found->residual;
    memcpy(own->best.data, drive, own->values * sizeof *drive);
  }
  return CLT_OK;
}

/* The weights of the older pairs against the newest that make the free residual of one channel least. */
static void weigh_pairs(const optical *own, int channel, int count, const int *pair, double *weight) {
  double normal[KEPT * KEPT] = {0}, trace = 0;
  const float *newest = own->residual[own->newest];
  memset(weight, 0, KEPT * sizeof *weight);
  for (size_t at = (size_t)channel * own->cells; at < (size_t)(channel + 1) * own->cells; at++) {
    double change[KEPT];
    for (int s = 0; own->free[at] && s < count; s++) {
      change[s] = (double)own->residual[pair[s]][at] - (double)newest[at];
      weight[s] -= change[s] * (double)newest[at];
      for (int t = 0; t <= s; t++) {
        normal[s * count + t] += change[s] * change[t];
      }
    }
  }
  for (int s = 0; s < count; s++) {
    trace += normal[s * count + s];
  }
  for (int s = 0; s < count; s++) {
    normal[s * count + s] += RIDGE * trace;
  }
  if (count > 0 && LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', count, 1, normal, count, weight, 1) != 0) {
    memset(weight, 0, KEPT * sizeof *weight);
  }
}

/* session.drive = clip(x' + F^-1 r') */
static void next_drive(optical *own) {
  const int count = (own->pairs < KEPT ? own->pairs : KEPT) - 1;
  int pair[KEPT];
  for (int s = 0; s < count; s++) {
    pair[s] = (own->newest + 1 + s + (own->pairs < KEPT ? KEPT - own->newest - 1 : 0)) % KEPT;
  }
  for (int c = 0; c < own->channels; c++) {
    double weight[KEPT];
    weigh_pairs(own, c, count, pair, weight);
    for (size_t at = (size_t)c * own->cells; at < (size_t)(c + 1) * own->cells; at++) {
      double x = (double)own->drive[own->newest][at], r = (double)own->residual[own->newest][at];
      for (int s = 0; s < count; s++) {
        x += weight[s] * ((double)own->drive[pair[s]][at] - (double)own->drive[own->newest][at]);
        r += weight[s] * ((double)own->residual[pair[s]][at] - (double)own->residual[own->newest][at]);
      }
      const double direct = (double)own->first_bounce[at];
      own->session.drive.data[at] = direct > 0 ? clip(x + r / direct) : 0;
    }
  }
}

/* Of the picture as it is: ||gain y - target|| / ||target|| with the best single gain, y the light less its black. */
static double error_before(const optical *own) {
  double both = 0, seen = 0, target = 0;
  for (size_t at = 0; at < own->values; at++) {
    if (own->first_bounce[at] > 0) {
      const double wanted = (double)own->wanted[at] + (double)own->session.black.data[at];
      const double y = wanted - (double)own->residual[own->newest][at];
      both += y * wanted;
      seen += y * y;
      target += wanted * wanted;
    }
  }
  return target > 0 && seen > 0 ? sqrt(fmax(1 - both * both / (seen * target), 0)) : 0;
}

/* The first two drives: the picture as it is, and what would be right were every cell's light shared as the flood's. */
static void start_drive(optical *own, const clt_image *picture, bool flood) {
  for (size_t at = 0; at < own->values; at++) {
    const double light = (double)own->flood[at];
    const double even = light > 0 ? (double)own->wanted[at] / light : 0;
    own->session.drive.data[at] = own->first_bounce[at] > 0 ? clip(flood ? even : (double)picture->data[at]) : 0;
  }
}

/* Why to stop after a photograph, or NULL. The residual's noise is no error of the drive. */
static const char *why_stop(const optical *own, const norms *found, int stalled) {
  const double wanted = own->tolerance * own->tolerance * found->target;
  if (found->free - found->free_noise <= wanted) {
    return "the wanted tolerance is reached";
  }
  if (found->free <= SAFETY * SAFETY * found->free_noise) {
    return "what is left is the noise of a photograph";
  }
  return stalled > PATIENCE ? "further photographs do not come nearer" : NULL;
}

/* Photographs drive after drive until there is a reason to stop. */
static clt_status iterate(optical *own, const clt_image *picture, clt_optical_result *result, clt_error *error) {
  norms found = {0}, best = {0};
  const char *reason = NULL;
  int stalled = 0;
  for (int k = 0; reason == NULL && own->session.progress.done < own->limit; k++) {
    const double before = own->best_norm;
    if (k < 2) {
      start_drive(own, picture, k == 1);
    } else {
      next_drive(own);
    }
    clt_status status = photograph(own, &found, error);
    if (status != CLT_OK) {
      return status;
    }
    result->error_before = k == 0 ? error_before(own) : result->error_before;
    best = own->best_norm < before ? found : best;
    stalled = own->best_norm < STALLED * before ? 0 : stalled + 1;
    if (result->curve_count < CLT_OPTICAL_CURVE_MAX) {
      result->curve[result->curve_count++] = found.target > 0 ? sqrt(found.residual / found.target) : 0;
    }
    reason = k > 0 ? why_stop(own, &found, stalled) : NULL;
  }
  result->converged = reason != NULL;
  result->noise = best.target > 0 ? sqrt(best.noise / best.target) : 0;
  result->error_after = best.target > 0 ? sqrt(fmax(best.residual - best.noise, 0) / best.target) : 0;
  snprintf(result->reason, sizeof result->reason, "%s",
           reason != NULL ? reason : "the photographs allowed are used up");
  return CLT_OK;
}

static void describe(const optical *own, clt_optical_result *result) {
  size_t clipped = 0, lit = 0;
  for (size_t at = 0; at < own->values; at++) {
    if (own->first_bounce[at] > 0) {
      lit++;
      clipped += own->best.data[at] <= 0 || own->best.data[at] >= 1;
    }
  }
  clt_rig_info now;
  own->session.rig->operations->describe(own->session.rig, &now);
  result->clipped_fraction = lit > 0 ? (double)clipped / (double)lit : 0;
  result->photographs = (int)own->session.progress.done;
  result->frames = (int)(now.frames - own->session.info.frames);
  result->seconds = own->session.progress.seconds;
}

clt_status clt_optical_compensate(clt_rig *rig, const clt_image *picture, const clt_optical_options *options,
                                  clt_image *drive, clt_optical_result *result, clt_error *error) {
  optical own;
  *drive = (clt_image){0};
  *result = (clt_optical_result){0};
  clt_status status = check_options(options, error);
  if (status != CLT_OK) {
    return status;
  }
  status = init(&own, rig, options, error);
  const clt_rig_info *info = &own.session.info;
  if (status == CLT_OK &&
      (picture->width != info->width || picture->height != info->height || picture->channels != info->channels)) {
    status = clt_fail(error, CLT_BAD_INPUT, "the picture is %d x %d with %d channels, the rig's grid %d x %d with %d",
                      picture->width, picture->height, picture->channels, info->width, info->height, info->channels);
  }
  if (status == CLT_OK) {
    status = prepare(&own, error);
  }
  if (status == CLT_OK) {
    status = find_wanted(&own, picture, &options->white, result->white, error);
  }
  if (status == CLT_OK) {
    status = iterate(&own, picture, result, error);
  }
  if (status == CLT_OK) {
    describe(&own, result);
    *drive = own.best;
    own.best = (clt_image){0};
  }
  finish(&own);
  return status;
}
