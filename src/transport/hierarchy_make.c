/* Hierarchies from other storage: what is alike however the leaves are found. */
#include "transport/hierarchy_make.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/order.h"

clt_status clt_hierarchic_reserve_cells(clt_transport *transport, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t channels = (size_t)transport->channels, cells = transport->cols;
  const bool left = clt_leaf_rows_reserve(&own->left, 32, channels, own->leaves, own->rank);
  const bool right = clt_leaf_rows_reserve(&own->right, 32, channels, own->leaves, own->rank);
  own->scale = clt_alloc(channels * cells, sizeof *own->scale);
  own->gather = clt_alloc(channels * cells, sizeof *own->gather);
  own->own = clt_alloc(channels * cells, sizeof *own->own);
  own->flood = clt_alloc(channels * cells, sizeof *own->flood);
  own->start = clt_alloc(cells + 1, sizeof *own->start);
  const bool all = left && right && own->scale != NULL && own->gather != NULL && own->own != NULL &&
                   own->flood != NULL && own->start != NULL;
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
      own->flood[(size_t)c * cells + i] += (float)(sums[i] - sums[cells + i]);
    }
  }
  free(sums);
  return CLT_OK;
}

/* Drives that light bands of 3, 9, 27... cells, across and down. */
enum { BAND_LEAST = 3, BAND_STEP = 3 };
static void light_bands(const clt_transport *of, size_t band, double *x) {
  const size_t width = (size_t)of->width;
  for (size_t j = 0; j < of->cols; j++) {
    x[j] = (j % width / band + j / width / band) % 2 == 0 ? 1 : 0;
  }
}

/* Products of a channel by what is to be compared. */
typedef void product(const void *of, int channel, const double *x, double *y);

/* ||a x - b x|| / ||a x|| over all channels, the worst of those drives; room holds 3 N. */
static double product_error(const clt_transport *like, product *multiply, const void *a, const void *b, double *room) {
  const size_t cells = like->cols;
  double *x = room, *y = room + cells, *z = room + 2 * cells, worst = 0;
  for (size_t band = BAND_LEAST; band <= 2 * (size_t)like->width; band *= BAND_STEP) {
    double apart = 0, whole = 0;
    light_bands(like, band, x);
    for (int c = 0; c < like->channels; c++) {
      multiply(a, c, x, y);
      multiply(b, c, x, z);
      for (size_t i = 0; i < cells; i++) {
        apart += (z[i] - y[i]) * (z[i] - y[i]);
        whole += y[i] * y[i];
      }
    }
    worst = fmax(worst, whole > 0 ? sqrt(apart / whole) : 0);
  }
  return worst;
}

static void multiply_transport(const void *of, int channel, const double *x, double *y) {
  clt_transport_apply(of, channel, x, y);
}

static clt_status measure_error(const clt_transport *from, clt_transport *to, clt_error *error) {
  clt_hierarchy_storage *own = to->storage;
  double *room = clt_alloc(from->cols, 3 * sizeof *room);
  if (room == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory to compare products of %zu cells", from->cols);
  }
  own->error = product_error(from, multiply_transport, from, to, room);
  free(room);
  return CLT_OK;
}

/* Factors that a hierarchy is to have for a product. */
typedef struct factors {
  clt_transport *transport;
  clt_leaf_rows left, right;
} factors;

static void multiply_factors(const void *of, int channel, const double *x, double *y) {
  const factors *with = of;
  clt_hierarchy_storage *own = with->transport->storage;
  const clt_leaf_rows left = own->left, right = own->right;
  own->left = with->left;
  own->right = with->right;
  clt_transport_apply(with->transport, channel, x, y);
  own->left = left;
  own->right = right;
}

/* The factors in the fewest bits that change products by no more than `most`. */
static clt_status pack(clt_transport *to, double most, clt_error *error) {
  static const int BITS[] = {8, 16};
  clt_hierarchy_storage *own = to->storage;
  const factors plain = {to, own->left, own->right};
  double *room = clt_alloc(to->cols, 3 * sizeof *room);
  bool packed = false, memory = room != NULL;
  for (size_t k = 0; k < sizeof BITS / sizeof BITS[0] && !packed && memory; k++) {
    factors coded = {.transport = to};
    memory =
        clt_leaf_rows_pack(&own->left, BITS[k], &coded.left) && clt_leaf_rows_pack(&own->right, BITS[k], &coded.right);
    packed = memory && product_error(to, multiply_factors, &plain, &coded, room) <= most;
    if (packed) {
      own->left = coded.left;
      own->right = coded.right;
      coded = plain;
    }
    clt_leaf_rows_finish(&coded.left);
    clt_leaf_rows_finish(&coded.right);
  }
  free(room);
  return memory ? CLT_OK : clt_fail(error, CLT_FAILED, "no memory for codes of far light of rank %zu", own->rank);
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

/* Row sums, error and bits. Codes add no more than a part of what leaves leave out, and of what they may. */
static clt_status finish(const clt_transport *from, clt_transport *to, double tolerance, clt_error *error) {
  static const double SHARE = 0.3;
  const clt_hierarchy_storage *own = to->storage;
  clt_status status = match_floods(from, to, error);
  if (status == CLT_OK) {
    status = measure_error(from, to, error);
  }
  if (status == CLT_OK) {
    status = pack(to, SHARE * fmin(tolerance, own->error), error);
  }
  if (status == CLT_OK && own->left.bits < 32) {
    status = match_floods(from, to, error);
    status = status == CLT_OK ? measure_error(from, to, error) : status;
  }
  return status;
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
    status = finish(from, to, tolerance, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(to);
    return status;
  }
  *out = to;
  return CLT_OK;
}
