/* Direct light and its near surroundings, from sparse grids of lit cells. */
#ifndef CLT_ACQUIRE_DIRECT_SCAN_H
#define CLT_ACQUIRE_DIRECT_SCAN_H

#include "acquire/session.h"

enum { CLT_SCAN_PITCH = 4, CLT_SCAN_PATTERNS = CLT_SCAN_PITCH * CLT_SCAN_PITCH };

/* What a cell gives itself and its 8 neighbours beyond the light that comes from everywhere, by compressed rows: the
 * entry (i, i) is always there, another where it is above the noise in some channel. Rows and cells are the grid's. */
typedef struct clt_near {
  int64_t *start;
  int32_t *cell;
  float *value;    /* channels x entries */
  float *variance; /* channels x cells: the sum over a row's entries; infinite where the cell was not seen */
} clt_near;

/* Shows CLT_SCAN_PATTERNS patterns, each cell lit in one of them and four cells from the next. */
clt_status clt_scan_direct(clt_session *session, clt_near *near, clt_error *error);
void clt_near_finish(clt_near *near); /* accepts a zeroed one */

/* light (cells values) = near light of channel c while the cells whose label is `lit` are fully driven. */
void clt_near_light(const clt_near *near, size_t cells, int channel, const int32_t *label, int32_t lit, float *light);

#endif
