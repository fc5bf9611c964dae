/* The linear system S l = b of one colour channel over its lit cells, or of all channels together.
 *
 * S = T F^-1 restricted to lit rows and lit columns; l = F x. Vectors keep their full length (rows or cols values) and
 * hold 0 at dark cells. Where rows = cols a row is lit with its cell; otherwise every row takes part. Channels together
 * are one system whose vectors hold channel after channel, and whose S has a block for each. */
#ifndef CLT_SOLVE_SYSTEM_H
#define CLT_SOLVE_SYSTEM_H

#include <cblas.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "counterlight/status.h"
#include "counterlight/transport.h"

typedef struct clt_system {
  const clt_transport *transport;
  size_t rows, cols; /* of a vector: those of the transport times channels */
  int channels;      /* in one system: 1, or all of the transport's */
  bool square;

  /* the channel that is selected, or the first of all */
  int channel;
  const double *first_bounce; /* F, cols values */
  const double *flux;         /* w, cols values; NULL while the certificate is being made */
  const double *flood;        /* S F, rows values: the light of every lit cell in full; NULL likewise */
  const double *reflood;      /* S S F where T is square, else 0; rows values; NULL likewise */
  const unsigned char *lit;   /* cols values */
  double reciprocity;
  double tolerance; /* relative residual that solves will ask for: what a method prepares for */
  void *prepared;   /* what the method that runs keeps of this system between solves; NULL where it keeps nothing */

  double *scale;        /* 1 / F at lit cells, 0 at dark ones; cols values */
  double *drive, *seen; /* operands of the products with T; cols and rows values */
  double *wanted;       /* b; rows values, 0 at dark rows */
  double *light;        /* l, the unknown: the start before a method runs, its best answer after; cols values */
  double wanted_norm;   /* ||b|| */
  double wanted_least;  /* the least ||b|| of its channels that is not 0: each is to reach a tolerance of its own */
  long products;        /* with T or T' */

  double *pool; /* a method's vectors of max(rows, cols) values; they hold nothing between two runs */
  size_t stride, pool_vectors;
} clt_system;

/* Workspace for any channel of the transport, or for all together; the transport must outlive the system. */
clt_status clt_system_init(clt_system *system, const clt_transport *transport, bool together, clt_error *error);
void clt_system_finish(clt_system *system); /* accepts a zeroed system */
/* Turns to a channel (0 where all are together); the arrays (cols values) must stay. light and wanted become 0. */
void clt_system_select(clt_system *system, int channel, const double *first_bounce, const unsigned char *lit);
/* Takes b from rows values, dropping dark rows. */
void clt_system_want(clt_system *system, const double *wanted);
/* The least norm of the channels of `values` (count of all) that is not 0, but at least a millionth of that of all. */
double clt_system_least_norm(const clt_system *system, const double *values, size_t count);
bool clt_system_row_is_lit(const clt_system *system, size_t row);
/* Makes room for a method's vectors. */
clt_status clt_system_reserve(clt_system *system, size_t vectors, clt_error *error);
double *clt_system_vector(const clt_system *system, size_t index);

/* out = S l: cols values to rows values. */
void clt_system_apply(clt_system *system, const double *l, double *out);
/* out = S' r: rows values to cols values. */
void clt_system_apply_transposed(clt_system *system, const double *r, double *out);
/* r = b - S l; returns ||r||. Without a product where l = 0, as at a cold start. */
double clt_system_residual(clt_system *system, const double *l, double *r);
/* r = b - T x over lit rows, of any drive x. */
void clt_system_drive_residual(clt_system *system, const double *drive, double *r);

/* Sums in a fixed order by the thread that calls. */
double clt_dot(size_t count, const double *a, const double *b);
double clt_norm(size_t count, const double *a);
/* y += factor x */
void clt_add(size_t count, double factor, const double *x, double *y);
static inline void clt_copy(size_t count, const double *from, double *to) {
  memcpy(to, from, count * sizeof *to);
}

#endif
