/* Hierarchies from other storage: what is alike however the leaves are found. */
#include "transport/hierarchy_make.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"

clt_status clt_hierarchic_reserve_cells(clt_transport *transport, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t channels = (size_t)transport->channels, cells = transport->cols;
  const size_t factor = channels * CLT_LEAF_TERMS * own->leaves;
  own->left = clt_alloc(factor, own->rank * sizeof *own->left);
  own->right = clt_alloc(factor, own->rank * sizeof *own->right);
  own->scale = clt_alloc(channels * cells, sizeof *own->scale);
  own->gather = clt_alloc(channels * cells, sizeof *own->gather);
  own->own = clt_alloc(channels * cells, sizeof *own->own);
  own->flood = clt_alloc(channels * cells, sizeof *own->flood);
  own->start = clt_alloc(cells + 1, sizeof *own->start);
  const bool all = own->left != NULL && own->right != NULL && own->scale != NULL && own->gather != NULL &&
                   own->own != NULL && own->flood != NULL && own->start != NULL;
  return all ? CLT_OK : clt_fail(error, CLT_FAILED, "no memory for a hierarchy over %zu cells", cells);
}

clt_status clt_hierarchic_reserve_near(clt_transport *transport, size_t entries, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  own->cell = clt_alloc(entries, sizeof *own->cell);
  own->value = clt_alloc(entries * (size_t)transport->channels, sizeof *own->value);
  return own->cell != NULL && own->value != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "no memory for %zu near entries of a hierarchy", entries);
}

double clt_own_light(const clt_transport *transport, int channel, double *room) {
  clt_transport_diagonal(transport, channel, room);
  clt_sort_doubles(room, transport->cols);
  const double median = room[transport->cols / 2];
  return median > 0 ? median : 1;
}

/* Every row's sum becomes that of the transport it was made from. */
static clt_status match_floods(const clt_transport *from, clt_transport *to, clt_error *error) {
  const size_t cells = from->cols;
  clt_hierarchy_storage *own = to->storage;
  double *sums = clt_alloc(cells, 2 * sizeof *sums);
  if (sums == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for the row sums of %zu cells", cells);
  }
  for (int c = 0; c < from->channels; c++) {
    clt_transport_row_sums(from, c, sums);
    clt_transport_row_sums(to, c, sums + cells);
    for (size_t i = 0; i < cells; i++) {
      own->flood[(size_t)c * cells + i] = (float)(sums[i] - sums[cells + i]);
    }
  }
  free(sums);
  return CLT_OK;
}

/* ||(T' - T) x|| / ||T x|| of one drive over all channels; x, y and z hold a channel. */
static double product_error(const clt_transport *from, const clt_transport *to, const double *x, double *y, double *z) {
  double apart = 0, whole = 0;
  for (int c = 0; c < from->channels; c++) {
    clt_transport_apply(from, c, x, y);
    clt_transport_apply(to, c, x, z);
    for (size_t i = 0; i < from->cols; i++) {
      apart += (z[i] - y[i]) * (z[i] - y[i]);
      whole += y[i] * y[i];
    }
  }
  return whole > 0 ? sqrt(apart / whole) : 0;
}

/* The worst of drives that light bands of 3, 9, 27... cells, across and down. */
static clt_status measure_error(const clt_transport *from, clt_transport *to, clt_error *error) {
  const size_t cells = from->cols, width = (size_t)from->width;
  clt_hierarchy_storage *own = to->storage;
  double *x = clt_alloc(cells, 3 * sizeof *x);
  if (x == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory to compare products of %zu cells", cells);
  }
  for (size_t band = 3; band <= 2 * width; band *= 3) {
    for (size_t j = 0; j < cells; j++) {
      x[j] = (j % width / band + j / width / band) % 2 == 0 ? 1 : 0;
    }
    own->error = fmax(own->error, product_error(from, to, x, x + cells, x + 2 * cells));
  }
  free(x);
  return CLT_OK;
}

static clt_status check_request(const clt_transport *from, double tolerance, clt_error *error) {
  if (!(tolerance >= 0 && tolerance < 1)) {
    return clt_fail(error, CLT_BAD_INPUT, "the tolerance of a hierarchy is %g; it is 0 or more and below 1", tolerance);
  }
  if (from->rows != from->cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "a hierarchy is made of a T whose rows are its cells; this one has %zu for %zu", from->rows,
                    from->cols);
  }
  return CLT_OK;
}

clt_status clt_transport_create_hierarchy(const clt_transport *from, double tolerance, clt_transport **out,
                                          clt_error *error) {
  *out = NULL;
  clt_transport *to = NULL;
  clt_status status = check_request(from, tolerance, error);
  if (status == CLT_OK) {
    status =
        clt_transport_begin(&clt_kind_hierarchy, from->width, from->height, from->channels, "a hierarchy", &to, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  to->provenance = from->provenance;
  status = from->kind == &clt_kind_blocks ? clt_hierarchy_from_blocks(from, tolerance, to, error)
                                          : clt_hierarchy_from_rows(from, tolerance, to, error);
  if (status == CLT_OK) {
    status = clt_transport_copy_planes(from, to, error);
  }
  if (status == CLT_OK) {
    status = match_floods(from, to, error);
  }
  if (status == CLT_OK) {
    status = measure_error(from, to, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(to);
    return status;
  }
  *out = to;
  return CLT_OK;
}
