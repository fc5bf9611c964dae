/* What an effect of the simulation is: one file each, one entry each in the table of table.c.
 *
 * Light takes this way, and an effect takes part in it by the functions that its entry has:
 *   panel codes -> drive                  (prepared as a table of codes)
 *   drive -> drive                        drive
 *   drive -> radiance of the cells        light, then radiance
 *   radiance over time -> exposure        frame, expose
 *   exposure -> electrons of the pixels   signal, electrons
 *   electrons -> samples                  samples
 * A scene that does not call for an effect neither prepares nor runs it. */
#ifndef CLT_SIM_EFFECTS_EFFECT_H
#define CLT_SIM_EFFECTS_EFFECT_H

#include "base/settings.h"
#include "counterlight/scene.h"
#include "sim/description.h"

/* Rows first <= row < last of an exposure, which share the time over which they are exposed. */
typedef struct clt_band {
  int first, last;
  int64_t start_ns, end_ns; /* end > start */
} clt_band;

/* Mean radiance of the cells over the exposure: radiance[(c * height + y) * width + x]. Row y belongs to row
 * y / split of the cells, where a rolling shutter exposes the rows of pixels one after the other. */
typedef struct clt_exposure {
  int width, height, channels, split;
  float *radiance;
  float *scratch; /* as large; there where a stage has `expose` */
} clt_exposure;

/* Row y of a channel. */
static inline float *clt_exposure_row(const clt_exposure *exposure, int channel, int y) {
  return &exposure->radiance[((size_t)channel * (size_t)exposure->height + (size_t)y) * (size_t)exposure->width];
}

/* What reaches the sensor: radiance[(c * height + y) * width + x], of a pixel where an effect tells pixels of a cell
 * apart, else of a cell, or of a row of a cell's pixels. */
typedef struct clt_signal {
  int width, height, channels;
  float *radiance;
  float *scratch;    /* as large; there where a stage has `signal` */
  double *electrons; /* as large: the mean number of electrons */
  double *none; /* as large: probability of no electron where that is needed; there where a stage has `electrons` */
} clt_signal;

/* Some samples of one row on their way: electrons first, then fractions of full well, at last sample values. */
typedef struct clt_row {
  uint64_t key;       /* of the frame's random numbers (sim/noise.h) */
  size_t first;       /* number of the first sample in the frame */
  int count;          /* of samples */
  double *values;     /* count values */
  const double *none; /* count probabilities of no electron, or NULL */
} clt_row;

/* What becomes of a frame on its way to the program. */
typedef struct clt_fate {
  bool dropped;    /* never arrives */
  bool stuck;      /* carries the samples of the frame before */
  double dark;     /* share of its rows, from the bottom up, that carry no light */
  int64_t late_ns; /* arrives that long after its exposure */
} clt_fate;

typedef struct clt_effect clt_effect;

/* An effect that a scene calls for, prepared. */
typedef struct clt_stage {
  const clt_effect *effect;
  void *state;  /* the effect's own; NULL where it needs none */
  size_t bytes; /* that it holds */
  double prepare_ms;
} clt_stage;

struct clt_effect {
  const char *name;
  /* Reads its own keys of the scene file into the description; NULL where it has none. */
  void (*read)(clt_section root, clt_scene_description *description);
  /* Whether the scene calls for it, and why or why not (CLT_EFFECT_WHY_MAX characters). The scene's T is there. NULL:
   * this version does not simulate the effect. */
  bool (*called_for)(const clt_scene *scene, char *why);
  /* Sets stage->state and stage->bytes, or fields of the scene; NULL where nothing is to be prepared. */
  clt_status (*prepare)(clt_scene *scene, clt_stage *stage, clt_error *error);
  void (*finish)(
      void *state); /* frees the state, also a half-built one and NULL; NULL: the state belongs to the scene */
  /* Changes the drive of the cells, channels * cells values; scratch is twice as large. */
  void (*drive)(const void *state, float *drive, float *scratch);
  /* radiance = b0 + T drive. Without such a stage T is diagonal. */
  void (*light)(void *state, const float *drive, float *radiance);
  /* Changes the radiance of the cells, channels * cells values; scratch is twice as large. */
  void (*radiance)(const void *state, float *radiance, float *scratch);
  /* Decides what becomes of frame number `sequence`; fate was zeroed by the caller. */
  void (*frame)(const void *state, uint32_t sequence, clt_fate *fate);
  /* Whether the camera is unplugged at any time of from_ns <= t <= to_ns. */
  bool (*away)(const void *state, int64_t from_ns, int64_t to_ns);
  /* Changes one band of an exposure; bands come from the top, and together cover it. */
  void (*expose)(const void *state, clt_exposure *exposure, const clt_band *band);
  /* Changes signal->radiance. */
  void (*signal)(const void *state, clt_signal *signal);
  /* Fills signal->none from signal->electrons. */
  void (*electrons)(const void *state, clt_signal *signal);
  /* Changes row->values. */
  void (*samples)(const void *state, clt_row *row);
  bool per_row;   /* rows of pixels are exposed at different times */
  bool per_pixel; /* the pixels of a cell differ */
};

/* The `prepare` of effects whose state is the scene's description. */
clt_status clt_effect_lend_description(clt_scene *scene, clt_stage *stage, clt_error *error);

/* Every effect, in the order in which light meets them. */
extern const clt_effect *const clt_effects[CLT_EFFECTS];

#endif
