/* sRGB codes to linear light by a table: portable C, and instructions that this processor may have. Every variant adds
 * in the same order, so that the bits of a sum do not depend on the processor. */
#ifndef CLT_IMAGE_LIGHT_KERNELS_H
#define CLT_IMAGE_LIGHT_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CLT_LIGHT_CODES = 256 };

typedef struct clt_light_table {
  float light[CLT_LIGHT_CODES];                 /* of each code, 0..1 */
  uint8_t byte[sizeof(float)][CLT_LIGHT_CODES]; /* the same, byte by byte: for processors that look up bytes */
} clt_light_table;

/* Rows of codes that a row of cells lies on, behind the first of them. */
typedef struct clt_light_rows {
  const uint8_t *codes; /* codes[r * stride + k] */
  size_t stride, count;
  float before, after; /* the shares of the first row and of the last of `count`; those between have 1 */
} clt_light_rows;

typedef struct clt_light_kernels {
  const char *needs; /* what the processor must have; NULL: nothing */
  bool (*runs_here)(void);
  /* light[k] = the table's of codes[k], k < count */
  void (*look_up)(const clt_light_table *table, const uint8_t *codes, size_t count, float *light);
  /* sums[k] = before kept[k] + sum of the shares times the light of the rows; kept[k] is the light of the first row,
   * and becomes that of the last. */
  void (*add_rows)(const clt_light_table *table, const clt_light_rows *rows, size_t count, float *kept, float *sums);
} clt_light_kernels;

void clt_light_fill(clt_light_table *table);

/* Every variant, the fastest first, ended by the portable one and NULL; and the first that runs here. */
extern const clt_light_kernels *const clt_light_variants[];
const clt_light_kernels *clt_light_choose(void);

#endif
