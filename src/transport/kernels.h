/* The inner loops over plain numbers and over codes of 16 and 8 bits: portable C, and instructions that this processor
 * may have.
 *
 * Every variant of a kernel multiplies, adds and orders its sums alike (no fused operations), so that the bits of a
 * product do not depend on the processor. */
#ifndef CLT_TRANSPORT_KERNELS_H
#define CLT_TRANSPORT_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CLT_LANES = 32, CLT_BLOCK = 32 /* int8 codes under one scale */ };

/* Plain numbers, four rows of `count` at a time, so that a vector of doubles is read once for four. */
enum { CLT_PLAIN_ROWS = 4 };
typedef struct clt_plain_kernels {
  const char *needs; /* what the processor must have; NULL: nothing */
  bool (*runs_here)(void);
  /* sum_r = sum over k < count of row_rk x_k, in double and 8 partial sums */
  void (*dot_float)(const float *const row[CLT_PLAIN_ROWS], const double *x, size_t count, double sum[CLT_PLAIN_ROWS]);
  void (*dot_double)(const double *const row[CLT_PLAIN_ROWS], const double *x, size_t count,
                     double sum[CLT_PLAIN_ROWS]);
  /* x_k += (y_0 row_0k + y_1 row_1k) + (y_2 row_2k + y_3 row_3k) */
  void (*add_float)(const float *const row[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], size_t count, double *x);
  void (*add_double)(const double *const row[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], size_t count, double *x);
} clt_plain_kernels;

/* The same in float. */
typedef struct clt_float_kernels {
  const char *needs;
  bool (*runs_here)(void);
  /* x_k += (y_0 row_0k + y_1 row_1k) + (y_2 row_2k + y_3 row_3k) */
  void (*add)(const float *const row[CLT_PLAIN_ROWS], const float y[CLT_PLAIN_ROWS], size_t count, float *x);
  /* sum_r = sum over k < count of row_rk x_k, in 8 partial sums */
  void (*dot)(const float *const row[CLT_PLAIN_ROWS], const float *x, size_t count, float sum[CLT_PLAIN_ROWS]);
} clt_float_kernels;

/* Four columns of `count` numbers at a time, for products both ways at once. */
typedef struct clt_pass_kernels {
  const char *needs;
  bool (*runs_here)(void);
  /* sum_r = sum over k < count of column_rk x_k, in 8 partial sums, and
   * out_k += (y_0 column_0k + y_1 column_1k) + (y_2 column_2k + y_3 column_3k) */
  void (*pass)(const float *const column[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], const double *x, size_t count,
               double sum[CLT_PLAIN_ROWS], double *out);
} clt_pass_kernels;

/* Cells of a row side by side that lie in one leaf of a hierarchy (transport/hierarchy.h): the first of them, which of
 * the parts of leaves they belong to, how many, and where their u and v stand in the table of places. */
typedef struct clt_span {
  int32_t first, part;
  uint16_t count, u, v;
} clt_span;

/* Spans are worked through in their order. Planes of the cells have a step of 1; one of step 0 is alike in all spans.
 */
enum { CLT_LEAF_SUMS = 5 };
typedef struct clt_leaf_in {
  const double *place, *x;
  const float *cells, *weight;
  size_t x_step, weight_step;
} clt_leaf_in;
typedef struct clt_leaf_out {
  const double *place, *x;
  const float *own, *flood, *cells;
  size_t x_step, flood_step;
  double mean;
  const int32_t *leaf; /* of each part */
  const double *f;     /* leaves x CLT_PLAIN_ROWS */
  double *y;
} clt_leaf_out;
typedef struct clt_leaf_kernels {
  const char *needs;
  bool (*runs_here)(void);
  /* sums, parts x CLT_LEAF_SUMS, += those of cells x, u cells x, v cells x, u v cells x and weight x; over a span in 4
   * partial sums and one of the cells behind them */
  void (*sum)(const clt_leaf_in *in, const clt_span *span, size_t spans, double *sums);
  /* y = (own x + flood mean) + cells (f_0 + u f_1 + v f_2 + u v f_3) */
  void (*spread)(const clt_leaf_out *out, const clt_span *span, size_t spans);
} clt_leaf_kernels;

/* IEEE half-precision codes, all of them finite. */
typedef struct clt_half_kernels {
  const char *needs; /* what the processor must have; NULL: nothing */
  bool (*runs_here)(void);
  /* sum over k < count of code_k x_k in CLT_LANES partial sums */
  double (*dot)(const uint16_t *code, const float *x, size_t count);
  /* the same of four rows, for few columns, in 8 partial sums */
  void (*dots)(const uint16_t *const code[4], const float *x, size_t count, float sum[4]);
  /* x_k += (y_0 code_0k + y_1 code_1k) + (y_2 code_2k + y_3 code_3k) */
  void (*add)(const uint16_t *const code[4], const float y[4], size_t count, float *x);
} clt_half_kernels;

/* int8 codes in blocks of CLT_BLOCK with a scale each; the last block may be short. */
typedef struct clt_byte_kernels {
  const char *needs;
  bool (*runs_here)(void);
  /* sum over k < count of scale_b code_k x_k, b = k / CLT_BLOCK */
  double (*dot)(const int8_t *code, const float *scale, const float *x, size_t count);
  /* the same of four rows, for few columns, in 8 partial sums */
  void (*dots)(const int8_t *const code[4], const float *const scale[4], const float *x, size_t count, float sum[4]);
  /* x_k += (s_0 code_0k + s_1 code_1k) + (s_2 code_2k + s_3 code_3k), s_r = y_r scale_rb */
  void (*add)(const int8_t *const code[4], const float *const scale[4], const float y[4], size_t count, float *x);
} clt_byte_kernels;

/* Every variant, the fastest first, ended by the portable one and NULL. */
extern const clt_plain_kernels *const clt_plain_variants[];
extern const clt_float_kernels *const clt_float_variants[];
extern const clt_pass_kernels *const clt_pass_variants[];
extern const clt_leaf_kernels *const clt_leaf_variants[];
extern const clt_half_kernels *const clt_half_variants[];
extern const clt_byte_kernels *const clt_byte_variants[];
/* The first that runs here. */
const clt_plain_kernels *clt_plain_choose(void);
const clt_float_kernels *clt_float_choose(void);
const clt_pass_kernels *clt_pass_choose(void);
const clt_leaf_kernels *clt_leaf_choose(void);
const clt_half_kernels *clt_half_choose(void);
const clt_byte_kernels *clt_byte_choose(void);

/* A code's value, and the code nearest to a value of magnitude up to 65504 (ties to even). No code is subnormal: what
 * is below the least normal magnitude, 2^-14, becomes 0 or that. */
float clt_half_value(uint16_t code);
uint16_t clt_half_code(float value);

#endif
