/* Frames of a moving picture: from the codes of the content to the gain and offset with which a projector shows it
 * compensated (clt_live_picture), within the time that a frame has. */
#ifndef COUNTERLIGHT_FRAMES_H
#define COUNTERLIGHT_FRAMES_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/live.h"
#include "counterlight/solve.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_frames clt_frames;

typedef struct clt_frames_options {
  clt_live_options live;
  clt_white white; /* FEASIBLE: as AUTO, with `reach` */
  bool reach; /* target = white (scale picture + offset) with the least offset and the largest scale, at most 1, that
                 bring every lit cell of the pictures in reach of a drive in 0..1; else scale 1, offset 0, and what
                 is out of reach is clipped */
  double smooth_s; /* time constant with which scale and offset follow, s, > 0; 0 means 0.5 */
} clt_frames_options;

typedef enum clt_frames_stage {
  CLT_FRAMES_MEAN,   /* codes to light, averaged over the cells */
  CLT_FRAMES_MAP,    /* scale and offset */
  CLT_FRAMES_SOLVE,  /* the drive of the cells */
  CLT_FRAMES_FIELDS, /* gain and offset of the cells */
  CLT_FRAMES_STAGES
} clt_frames_stage;

typedef struct clt_frames_result {
  clt_live_result live;
  double scale, offset;         /* of the target */
  bool cut;                     /* another scene begins: scale and offset follow eight times as fast for a while */
  bool settled;                 /* the same content again would give the same */
  bool direct;                  /* the budget left no time for a step: since the last frame that had one the drive
                                 * follows the picture by its direct light only, x += (target - target of then) / F */
  double ms[CLT_FRAMES_STAGES]; /* wall time of each stage */
} clt_frames_result;

/* Makes what frames need, once for a transport with rows = cols of 1 or 3 channels; transport and certificate outlive
 * it. CLT_BAD_INPUT as clt_live_create. */
CLT_PUBLIC clt_status clt_frames_create(const clt_transport *transport, const clt_certificate *certificate,
                                        const clt_frames_options *options, clt_frames **out, clt_error *error);
CLT_PUBLIC void clt_frames_destroy(clt_frames *frames); /* accepts NULL */

/* One frame: content[(y * width + x) * 3 + c] of sRGB codes, stretched over the whole grid, `seconds` after the one
 * before. With p the content's light and F = diag(T), cell and channel get the drive x of clt_live_solve and
 *   gain = min(scale white / F, 4)      so that detail within a cell keeps its contrast on the surface
 *   offset = x - gain mean(p)           so that the cell as a whole has the drive x
 * in three channels each (a transport of one channel: three times the same, for the content's luminance), as
 * clt_live_picture takes them; both are 0 at dark cells. One call at a time. */
CLT_PUBLIC clt_status clt_frames_next(clt_frames *frames, const uint8_t *content, int width, int height, double seconds,
                                      float *gain, float *offset, clt_frames_result *result, clt_error *error);
/* The drive of the cells of the last frame: channels * cells values, owned by frames. */
CLT_PUBLIC const float *clt_frames_drive(const clt_frames *frames);
/* Another budget for the solve from the next frame on, ms; 0: no limit. */
CLT_PUBLIC void clt_frames_set_budget(clt_frames *frames, double budget_ms);

#ifdef __cplusplus
}
#endif
#endif
