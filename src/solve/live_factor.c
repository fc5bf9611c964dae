/* The small matrices of Newton steps. */
#include "solve/live_factor.h"

#include <cblas.h>
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum {
  TERMS = CLT_LEAF_TERMS,
  COUPLED_LEAST = 64, /* columns, whose factor costs next to nothing */
  LEAVES_AT_ONCE = 64,
  PRODUCTS = 3,
  RECOUNT = 256 /* factors, after which the products are summed anew: a change leaves its rounding behind */
};
/* Of a cell's own light: far light of smaller singular values is not coupled. */
static const float COUPLED = 0.1f;

/* factor' M other, M the moments of a weight. With the same side twice it is symmetric. */
typedef struct product {
  int weight;
  bool factor_left, other_left; /* else right */
} product;

static const product G = {0, false, true}, H = {1, false, false}, N = {2, true, true};
static const product *const products[PRODUCTS] = {&G, &H, &N};

/* Both sides of a channel's far light in floats, U = diag(k) P left and V = diag(v) P right: the first columns of each
 * of 4L rows. */
typedef struct sides {
  const float *left, *right;
  size_t columns;
} sides;

static sides coupled_of(const clt_far *far, int channel) {
  const size_t nodes = TERMS * far->hierarchy->leaves, count = far->coupled[channel];
  const float *both = far->columns[channel];
  return (sides){both, both + nodes * count, count};
}

static clt_live_item *items_of(const clt_far *far, int channel) {
  return far->item + (size_t)channel * far->hierarchy->leaves;
}

/* Room for two times the terms of some leaves, of the whole rank. */
static size_t room_size(const clt_far *far) {
  return 2 * (size_t)TERMS * LEAVES_AT_ONCE * far->rank;
}

static float *room_of(const clt_far *far, int channel, int k) {
  return far->tall + (size_t)(channel * PRODUCTS + k) * room_size(far);
}

static float *product_of(const clt_far *far, int channel, int k) {
  return far->product + (size_t)(channel * PRODUCTS + k) * (far->order / 2) * (far->order / 2);
}

/* to = M from over a leaf: the entry of M for the terms u^a v^b and u^c v^d is the moment of u^(a+c) v^(b+d). */
static void weigh_rows(const float moment[CLT_LIVE_MOMENTS], const float *from, size_t columns, float *to) {
  for (size_t s = 0; s < TERMS; s++) {
    const float *of = moment + 3 * (s / 2) + s % 2;
    for (size_t r = 0; r < columns; r++) {
      to[s * columns + r] = (of[0] * from[r] + of[1] * from[columns + r]) +
                            (of[3] * from[2 * columns + r] + of[4] * from[3 * columns + r]);
    }
  }
}

/* By how much a weight's moments differ from those that were counted; false: not at all. */
static bool has_changed(const clt_live_item *item, int weight, float change[CLT_LIVE_MOMENTS]) {
  bool changed = false;
  for (int k = 0; k < CLT_LIVE_MOMENTS; k++) {
    change[k] = item->weight[weight][k] - item->counted[weight][k];
    changed = changed || change[k] != 0;
  }
  return changed;
}

/* sum += plain' weighed, rows x columns each, rows of a term after each other; column-major. Of a symmetric one, whose
 * upper half nobody reads, what lies above blocks on the diagonal is left out. */
static void add_product(const float *plain, const float *weighed, size_t rows, size_t columns, bool symmetric,
                        float *sum) {
  enum { BLOCK = 48 };
  const size_t step = symmetric ? BLOCK : columns;
  for (size_t first = 0; first < columns && rows > 0; first += step) {
    const size_t wide = columns - first < step ? columns - first : step;
    cblas_sgemm(CblasColMajor, CblasNoTrans, CblasTrans, (blasint)(columns - first), (blasint)wide, (blasint)rows, 1,
                plain + first, (blasint)columns, weighed + first, (blasint)columns, 1, sum + first * columns + first,
                (blasint)columns);
  }
}

/* Brings sum = factor' M other up to date with the weights; column-major. Of a symmetric product the lower half. */
static void update_product(const clt_far *far, int channel, const product *of, sides from, float *room, float *sum) {
  float *plain = room, *weighed = room + room_size(far) / 2, change[CLT_LIVE_MOMENTS];
  const size_t leaves = far->hierarchy->leaves, columns = from.columns;
  const float *factor = of->factor_left ? from.left : from.right, *other = of->other_left ? from.left : from.right;
  for (size_t leaf = 0; leaf < leaves;) {
    size_t rows = 0;
    for (; leaf < leaves && rows < TERMS * LEAVES_AT_ONCE; leaf++) {
      if (has_changed(&items_of(far, channel)[leaf], of->weight, change)) {
        weigh_rows(change, other + TERMS * leaf * columns, columns, weighed + rows * columns);
        memcpy(plain + rows * columns, factor + TERMS * leaf * columns, TERMS * columns * sizeof *plain);
        rows += TERMS;
      }
    }
    add_product(plain, weighed, rows, columns, of->factor_left == of->other_left, sum);
  }
}

/* An entry of a symmetric product. */
static float lower_of(const float *sum, size_t columns, size_t i, size_t j) {
  return i < j ? sum[i * columns + j] : sum[j * columns + i];
}

/* squares_r = side_r' M side_r, M the moments of v k / D. */
static void measure_columns(const clt_far *far, int channel, const float *side, double *squares) {
  const size_t rank = far->rank;
  memset(squares, 0, rank * sizeof *squares);
  for (size_t leaf = 0; leaf < far->hierarchy->leaves; leaf++) {
    const float *rows = side + TERMS * leaf * rank;
    weigh_rows(items_of(far, channel)[leaf].weight[0], rows, rank, far->tall);
    for (size_t m = 0; m < TERMS * rank; m++) {
      squares[m % rank] += (double)rows[m] * (double)far->tall[m];
    }
  }
}

/* How many columns of far light are coupled: all up to the last that is not small. squares holds 2 R. */
static void choose_coupled(clt_far *far, int channel, sides whole, double *squares) {
  const size_t rank = far->rank;
  double *left = squares, *right = squares + rank;
  measure_columns(far, channel, whole.left, left);
  measure_columns(far, channel, whole.right, right);
  far->coupled[channel] = rank < COUPLED_LEAST ? rank : COUPLED_LEAST;
  for (size_t r = 0; r < rank; r++) {
    if (r >= far->coupled[channel] && left[r] * right[r] > (double)COUPLED * (double)COUPLED) {
      far->coupled[channel] = r + 1;
    }
  }
}

/* Both sides of a channel in floats, left with its core: into `both`, 2 x 4L x R; room holds 4L x R. */
static sides read_sides(const clt_far *far, int channel, float *both, float *room) {
  const clt_hierarchy_storage *of = far->hierarchy;
  const size_t nodes = TERMS * of->leaves, rank = far->rank;
  float *left = both, *right = both + nodes * rank, *plain = of->core != NULL ? room : left;
  for (size_t leaf = 0; leaf < of->leaves; leaf++) {
    clt_leaf_rows_read(&of->left, channel, leaf, plain + TERMS * leaf * rank);
    clt_leaf_rows_read(&of->right, channel, leaf, right + TERMS * leaf * rank);
  }
  if (of->core != NULL) {
    const blasint wide = (blasint)rank;
    cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (blasint)nodes, wide, wide, 1, plain, wide,
                of->core + (size_t)channel * rank * rank, wide, 0, left, wide);
  }
  return (sides){left, right, rank};
}

/* Keeps the columns that are coupled. */
static bool keep_columns(clt_far *far, int channel, sides whole) {
  const size_t nodes = TERMS * far->hierarchy->leaves, count = far->coupled[channel];
  float *left = far->columns[channel] = clt_alloc(2 * nodes, count * sizeof *left);
  for (size_t m = 0; left != NULL && m < nodes; m++) {
    memcpy(left + m * count, whole.left + m * whole.columns, count * sizeof *left);
    memcpy(left + (nodes + m) * count, whole.right + m * whole.columns, count * sizeof *left);
  }
  return left != NULL;
}

/* What is known of a channel where no cell is held: V' D^-2 V, and how much is coupled. */
static clt_status prepare_channel(clt_far *far, int channel, clt_error *error) {
  clt_live_item *item = items_of(far, channel);
  const size_t rank = far->rank, nodes = TERMS * far->hierarchy->leaves;
  for (size_t k = 0; k < far->hierarchy->leaves; k++) {
    far->kernels->weigh(far, &item[k]);
  }
  float *tall = clt_alloc(3 * nodes, rank * sizeof *tall), *gram = far->gram + (size_t)channel * rank * rank;
  double *squares = clt_alloc(2 * rank, sizeof *squares);
  bool done = tall != NULL && squares != NULL;
  if (done) {
    const sides whole = read_sides(far, channel, tall, tall + 2 * nodes * rank);
    update_product(far, channel, &H, whole, far->tall, gram);
    for (size_t at = 0; at < rank * rank; at++) {
      gram[at] = lower_of(gram, rank, at % rank, at / rank);
    }
    choose_coupled(far, channel, whole, squares);
    done = keep_columns(far, channel, whole);
  }
  free(tall);
  free(squares);
  return done ? CLT_OK : clt_fail(error, CLT_FAILED, "no memory for far light of rank %zu", rank);
}

/* The factor of a channel that serves now, and its pivots. */
static float *factor_now(const clt_far *far, int channel) {
  return far->factor + (2 * (size_t)channel + far->bound[channel]) * far->order * far->order;
}

static int *pivots_now(const clt_far *far, int channel) {
  return far->pivots + (2 * (size_t)channel + far->bound[channel]) * far->order;
}

static clt_status reserve(clt_far *far, clt_error *error) {
  const size_t channels = (size_t)far->channels;
  for (int c = 0; c < far->channels; c++) {
    far->order = 2 * far->coupled[c] > far->order ? 2 * far->coupled[c] : far->order;
  }
  far->factor = clt_alloc(2 * channels * far->order, far->order * sizeof *far->factor);
  far->product = clt_alloc(channels * PRODUCTS * far->order, far->order * sizeof *far->product / 4);
  far->pivots = clt_alloc(2 * channels, far->order * sizeof *far->pivots);
  if (far->factor == NULL || far->product == NULL || far->pivots == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for factors of far light of rank %zu", far->rank);
  }
  return CLT_OK;
}

clt_status clt_factor_create(clt_far *far, clt_error *error) {
  const bool every[CLT_CHANNELS_MAX] = {true, true, true};
  clt_status status = CLT_OK;
  far->tall = clt_alloc((size_t)(far->channels * PRODUCTS), room_size(far) * sizeof *far->tall);
  if (far->tall == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for products of far light of rank %zu", far->rank);
  }
  far->open = true;
  for (int c = 0; status == CLT_OK && c < far->channels; c++) {
    status = prepare_channel(far, c, error);
  }
  status = status == CLT_OK ? reserve(far, error) : status;
  if (status == CLT_OK && !clt_factor_renew(far, every)) {
    status = clt_fail(error, CLT_FAILED, "far light of rank %zu has a singular factor", far->rank);
  }
  memset(far->ready, 0, sizeof far->ready);
  far->open = false;
  return status;
}

void clt_factor_destroy(clt_far *far) {
  free(far->factor);
  free(far->product);
  free(far->pivots);
  free(far->tall);
  for (int c = 0; c < far->channels; c++) {
    free(far->columns[c]);
  }
}

static void weigh_items(clt_far *far, const bool wanted[CLT_CHANNELS_MAX]) {
#pragma omp for schedule(dynamic, 8)
  for (size_t k = 0; k < far->items; k++) {
    clt_live_item *item = &far->item[k];
    if (wanted[item->channel]) {
      far->kernels->weigh(far, item);
      if (far->counts[item->channel] % RECOUNT == 0) {
        memset(item->counted, 0, sizeof item->counted);
      }
    }
  }
}

static void update_products(clt_far *far, const bool wanted[CLT_CHANNELS_MAX]) {
#pragma omp for schedule(dynamic, 1)
  for (int at = 0; at < far->channels * PRODUCTS; at++) {
    const int channel = at / PRODUCTS, k = at % PRODUCTS;
    const size_t count = far->coupled[channel];
    float *sum = product_of(far, channel, k);
    if (wanted[channel]) {
      if (far->counts[channel] % RECOUNT == 0) {
        memset(sum, 0, count * count * sizeof *sum);
      }
      update_product(far, channel, products[k], coupled_of(far, channel), room_of(far, channel, k), sum);
    }
  }
}

/* The matrix of a step, of the columns that are coupled, from its products. */
static void lay_out(const clt_far *far, int channel, float *matrix) {
  const size_t count = far->coupled[channel], order = 2 * count;
  const float *g = product_of(far, channel, 0), *h = product_of(far, channel, 1), *n = product_of(far, channel, 2);
  for (size_t j = 0; j < count; j++) {
    for (size_t i = 0; i < count; i++) {
      const float entry = g[j * count + i] + (i == j ? 1.0f : 0.0f);
      matrix[j * order + i] = matrix[(count + i) * order + count + j] = entry;
      matrix[(count + j) * order + i] = -lower_of(h, count, i, j);
      matrix[j * order + count + i] = lower_of(n, count, i, j);
    }
  }
}

static void take_factor(clt_far *far, int channel) {
  const lapack_int order = (lapack_int)(2 * far->coupled[channel]);
  float *matrix = factor_now(far, channel);
  clt_live_item *item = items_of(far, channel);
  lay_out(far, channel, matrix);
  for (size_t k = 0; k < far->hierarchy->leaves; k++) {
    memcpy(item[k].known, item[k].held, sizeof item[k].known);
    memcpy(item[k].counted, item[k].weight, sizeof item[k].counted);
  }
  far->counts[channel]++;
  far->ready[channel] =
      LAPACKE_sgetrf_work(LAPACK_COL_MAJOR, order, order, matrix, order, pivots_now(far, channel)) == 0;
}

bool clt_factor_renew(clt_far *far, const bool wanted[CLT_CHANNELS_MAX]) {
  bool ready = true;
#pragma omp parallel if (far->shared)
  {
    weigh_items(far, wanted);
    update_products(far, wanted);
#pragma omp for schedule(dynamic, 1)
    for (int c = 0; c < far->channels; c++) {
      if (wanted[c]) {
        take_factor(far, c);
      }
    }
  }
  for (int c = 0; c < far->channels; c++) {
    ready = ready && (!wanted[c] || far->ready[c]);
  }
  return ready;
}

void clt_factor_solve(const clt_far *far, int channel, float *answer) {
  const lapack_int order = (lapack_int)(2 * far->coupled[channel]);
  LAPACKE_sgetrs_work(LAPACK_COL_MAJOR, 'N', order, 1, factor_now(far, channel), order, pivots_now(far, channel),
                      answer, order);
}
