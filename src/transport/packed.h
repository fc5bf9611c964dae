/* What dense storage of fewer bits than a float shares: products in float over tiles, added up in double.
 *
 * T_ij = code * scale + offset_i off the diagonal, T_ii = diagonal_i in float. A product multiplies codes with a tile
 * of x (or of y) that was divided by a power of two, so that neither large nor small vectors leave float's range, and
 * adds the tile's sum, which kernels give in at least 16 lanes, to a double. */
#ifndef CLT_TRANSPORT_PACKED_H
#define CLT_TRANSPORT_PACKED_H

#include "transport/kind.h"

enum {
  CLT_PACKED_SPAN = 1024, /* columns that are added up in float */
  CLT_PACKED_GROUP = 4    /* rows that a transposed product adds at once */
};

/* How the codes of a storage are multiplied. `first` is a multiple of 32, count at most CLT_PACKED_SPAN. */
typedef struct clt_packed_form {
  /* sum over k < count of T_ij x_k, j = first + k, without offset and diagonal */
  double (*dot)(const clt_transport *transport, int channel, size_t row, size_t first, size_t count, const float *x);
  /* The factor by which y_i is multiplied before it becomes a float; NULL: 1. */
  double (*row_factor)(const clt_transport *transport, int channel, size_t row);
  /* x_k += sum over the group's rows i of y_i T_ij (y with its row factors), without offset and diagonal */
  void (*add)(const clt_transport *transport, int channel, const size_t row[CLT_PACKED_GROUP],
              const float y[CLT_PACKED_GROUP], size_t first, size_t count, float *x);
  /* values_j = T_ij of a whole row, without offset and diagonal */
  void (*decode)(const clt_transport *transport, int channel, size_t row, double *values);
} clt_packed_form;

/* Begins the storage of every packed kind. */
typedef struct clt_packed {
  const clt_packed_form *form;
  float *diagonal; /* channels x min(rows, cols) */
  float *offset;   /* channels x rows; NULL: none */
} clt_packed;

/* Functions of clt_kind. */
void clt_packed_apply(const clt_transport *transport, int channel, const double *x, double *y);
void clt_packed_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x);
void clt_packed_diagonal(const clt_transport *transport, int channel, double *diagonal);
void clt_packed_row(const clt_transport *transport, int channel, size_t row, double *values);
float *clt_packed_entries(const clt_transport *transport, int channel); /* NULL */

/* Takes the diagonal's entry of a row that is being put, where the row has one. */
void clt_packed_put_diagonal(clt_transport *transport, int channel, size_t row, const double *values);
/* How many entries of a channel stand on the diagonal, and one of them. */
size_t clt_packed_diagonal_count(const clt_transport *transport);
double clt_packed_diagonal_entry(const clt_transport *transport, int channel, size_t i);
/* Fails as a code on the diagonal of the dataset `name` is not 0. */
clt_status clt_packed_refuse_diagonal(const char *path, const char *name, int channel, size_t i, clt_error *error);

#endif
