/* The radiance of every cell under a drive, cheap for sparse patterns. */
#ifndef CLT_SIM_APPEARANCE_H
#define CLT_SIM_APPEARANCE_H

#include "counterlight/transport.h"
#include "sim/description.h"

typedef struct clt_appearance {
  const clt_transport *transport; /* outlives the appearance */
  size_t cells;
  int channels;
  /* Of a dense transport: T of each channel with a drive cell's column contiguous, columns[c][j * cells + i] = T_ij;
   * channels with the same T share it. NULL of other storage, whose products are cheap themselves. */
  float *columns[CLT_SIM_CHANNELS_MAX];
  size_t *driven;       /* cells values of work space */
  double *drive, *seen; /* channels * cells values each of work space */
} clt_appearance;

/* appearance was zeroed by the caller and is finished by it in either case. */
clt_status clt_appearance_init(clt_appearance *appearance, const clt_transport *transport, clt_error *error);
void clt_appearance_finish(clt_appearance *appearance);

/* Memory that it holds. */
size_t clt_appearance_bytes(const clt_appearance *appearance);

/* radiance = b0 + T drive, channels * cells values each; a drive cell at 0 costs nothing. The same for any number of
 * threads. One call at a time. */
void clt_appearance_of(clt_appearance *appearance, const float *drive, float *radiance);

#endif
