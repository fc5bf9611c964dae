/* Uniform fields: what the camera sees of a panel that shows one code per channel everywhere, averaged over the pixels
 * that the projector lights well and over frames. Every pixel's light is linear in the panel's light, however the room
 * passes it on, so that the mean over any fixed set of pixels is too. */
#ifndef CLT_RIG_PHOTOMETRY_FIELD_H
#define CLT_RIG_PHOTOMETRY_FIELD_H

#include "counterlight/image.h"
#include "rig/photometry/steady.h"

enum { CLT_FIELD_CHANNELS = 3, CLT_FIELD_GROUPS = 4 };

/* The bench of photometry. Pixels that are well lit are told apart by their brightness, in groups of equal number. */
typedef struct clt_field_bench {
  clt_shots *shots; /* not owned */
  clt_steady steady;
  float *codes;   /* of the panel */
  int channels;   /* of panel and camera */
  size_t pixels;  /* of the camera */
  uint8_t *group; /* of each pixel, 1..CLT_FIELD_GROUPS; 0: not well lit */
  size_t lit;     /* pixels in all groups */
  float *light;   /* of every code value, fraction of full scale */
  double black_level;
  int done, expected;                                   /* fields taken, and until the end, which may grow */
  bool (*progress)(void *context, int done, int total); /* after every field; false stops it. May be NULL */
  void *context;
} clt_field_bench;

/* What one field looked like. */
typedef struct clt_field {
  double light[CLT_FIELD_CHANNELS];     /* mean over the lit pixels, fraction of full scale */
  double saturated[CLT_FIELD_CHANNELS]; /* share of lit pixels near full scale */
  double brightest;                     /* largest over channels of the groups' mean sample, fraction of full scale */
  double seconds;                       /* exposure that the frames had */
  double at_s;                          /* middle of the exposures, on the camera's clock */
} clt_field;

/* Until groups are found, all pixels are lit. light starts linear above the driver's black level. */
clt_status clt_field_bench_init(clt_field_bench *bench, clt_shots *shots, clt_error *error);
void clt_field_bench_finish(clt_field_bench *bench);
/* Takes the black level and the camera's response for all that follows. */
void clt_field_set_response(clt_field_bench *bench, double black_level, const clt_curve *response);

/* Shows a uniform field; *ready_ns: exposures from then on see it. */
clt_status clt_field_show(clt_field_bench *bench, const double code[CLT_FIELD_CHANNELS], int64_t *ready_ns,
                          clt_error *error);
/* Takes the mean over `frames` frames of what is shown, which agree with each other where they are three or more, and
 * hands each frame to `look` (which may be NULL). CLT_CANCELLED where the progress says so. */
typedef void clt_field_look(void *context, const clt_field_bench *bench, const clt_frame *frame);
clt_status clt_field_take(clt_field_bench *bench, int64_t ready_ns, double seconds, int frames, clt_field_look *look,
                          void *context, clt_field *field, clt_error *error);
/* Both, without a look. */
clt_status clt_field_see(clt_field_bench *bench, const double code[CLT_FIELD_CHANNELS], double seconds, int frames,
                         clt_field *field, clt_error *error);

/* Sorts the pixels into groups by how much brighter the white panel makes them than the dark one, by `seconds` of
 * exposure. Well lit are those of at least a quarter of the 90th percentile. CLT_FAILED where the projector hardly
 * changes what the camera sees. */
clt_status clt_field_find_groups(clt_field_bench *bench, double seconds, int frames, clt_error *error);

#endif
