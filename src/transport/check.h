/* What the values of a transport must be, in memory and in a file. */
#ifndef CLT_TRANSPORT_CHECK_H
#define CLT_TRANSPORT_CHECK_H

#include <stdint.h>

#include "counterlight/transport.h"

/* A named block of values, as messages speak of it: "room.h5: /dense[0, 3, 4] is NaN". */
typedef struct clt_values {
  const char *source; /* the file, or what else holds the values */
  const char *name;
  int rank;        /* 1..3 */
  size_t shape[3]; /* the first rank sizes */
  const float *data;
} clt_values;

/* Every value is finite. */
clt_status clt_check_finite(const clt_values *values, clt_error *error);
/* Entries of T: finite, and none below -1e-2 of the largest; noise may make an entry slightly negative. */
clt_status clt_check_entries(const clt_values *values, clt_error *error);
/* The same of a transport whose kind gives rows, for its dataset or group `name`. */
clt_status clt_check_rows(const clt_transport *transport, const char *source, const char *name, clt_error *error);
/* Standard deviations: not negative, not NaN; infinite where a cell was never seen. */
clt_status clt_check_deviations(const clt_values *values, clt_error *error);

/* Compressed rows of a group: start has cells + 1 values that ascend from 0 to entries, cell has entries cells.
 * CLT_BAD_INPUT names the first that is not so. */
clt_status clt_check_near(const char *source, const char *group, const int64_t *start, const int32_t *cell,
                          size_t cells, size_t entries, clt_error *error);

#endif
