/* From any storage to a hierarchy, by its rows.
 *
 * With s what the cells of the grid take up of each other's light and g what they give, far light is s_i g_j q_ij, and
 * over a pair of leaves q is bilinear in both: q = p_i' M p_j with 4 x 4 numbers of M a pair, by least squares. What T
 * has beyond that stands as near entries, the largest first, until the rest may be left out. Near entries then take no
 * part in the fit: each round fits to T where it is far, and to the fit before where it is near (Dempster, Laird &
 * Rubin 1977: values that are missing). Noise that T tells of itself is left out as well; the bilinear fit smooths it.
 */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/hierarchy_make.h"
#include "transport/hierarchy_tree.h"

enum {
  SIDE_LEAST = 3,
  NODES_MOST = 768,
  ROUNDS = 8,
  BINS = 256,
  BINS_OCTAVE = 4,
  OCTAVES_BELOW = 50,
  TERMS = CLT_LEAF_TERMS
};
#define STRICTER                                                                                                       \
  3.0 /* from round to round: what is near must be so by far at first, or what lies around it is taken along */
#define SINGULAR 1e-9 /* of a leaf's first moment: a function that is none over so narrow a leaf */
#define RANK_SHARE                                                                                                     \
  4.0 /* of the tolerance: what lower rank loses of few entries they take up themselves, at less room */
#define MOST_NEAR 0.25 /* of all entries: a T that has more of them near is no hierarchy */

typedef struct fit {
  const clt_transport *from;
  clt_transport *to;
  clt_hierarchy_storage *own;
  size_t cells, channels, nodes;
  double tolerance;
  int32_t *leaf_of;       /* N */
  double *term;           /* N x 4: 1, u, v, u v */
  double *scale, *gather; /* channels x N: s and g, of mean square 1 */
  double *inverse_to,
      *inverse_from;               /* channels x leaves x 4 x 4: of the sums of s^2 p p' and of g^2 p p' over a leaf */
  double *core, *next;             /* channels x 4L x 4L: M, and that of the round after */
  double *energy;                  /* leaves x channels x BINS: squares of what T has beyond M, by their size */
  double light[CLT_CHANNELS_MAX];  /* own light of a cell, the unit of those sizes */
  double budget[CLT_CHANNELS_MAX]; /* sum of squares that may be left out */
  double noise[CLT_CHANNELS_MAX];  /* and what the noise that T tells of itself adds to it */
  double least[CLT_CHANNELS_MAX];  /* square of an entry beyond M that is near */
} fit;

/* A row of T as one thread sees it. */
typedef struct view {
  double *row, *apart; /* channels x N: T_ij, and what it has beyond M */
  double *spread;      /* 4L: s_i p_i' M */
  clt_error error;
  clt_status status;
} view;

/* What is done with every row of a leaf; threads have leaves of their own. */
typedef void visit(fit *f, size_t leaf, size_t i, view *v);

static bool open_view(const fit *f, view *v) {
  const size_t values = f->channels * f->cells;
  *v = (view){.row = clt_alloc(2 * values + f->nodes, sizeof *v->row)};
  if (v->row == NULL) {
    v->status = clt_fail(&v->error, CLT_FAILED, "no memory for a row of %zu cells", f->cells);
    return false;
  }
  v->apart = v->row + values;
  v->spread = v->apart + values;
  return true;
}

static void look(const fit *f, size_t i, view *v) {
  const double *p = f->term + TERMS * i;
  for (size_t c = 0; c < f->channels && v->status == CLT_OK; c++) {
    const size_t at = c * f->cells;
    const double *core = f->core + (c * f->nodes + TERMS * (size_t)f->leaf_of[i]) * f->nodes;
    v->status = clt_transport_row(f->from, (int)c, i, v->row + at, &v->error);
    for (size_t m = 0; m < f->nodes; m++) {
      double sum = 0;
      for (size_t s = 0; s < TERMS; s++) {
        sum += p[s] * core[s * f->nodes + m];
      }
      v->spread[m] = f->scale[at + i] * sum;
    }
    for (size_t j = 0; j < f->cells; j++) {
      const double *q = v->spread + TERMS * (size_t)f->leaf_of[j], *u = f->term + TERMS * j;
      v->apart[at + j] = v->row[at + j] - f->gather[at + j] * (q[0] * u[0] + q[1] * u[1] + q[2] * u[2] + q[3] * u[3]);
    }
  }
}

/* Calls `each` for every row, leaf by leaf. */
static clt_status for_rows(fit *f, visit *each, clt_error *error) {
  clt_status status = CLT_OK;
#pragma omp parallel
  {
    view v;
    const bool open = open_view(f, &v);
#pragma omp for schedule(dynamic)
    for (size_t k = 0; k < f->own->leaves; k++) {
      const clt_leaf leaf = f->own->leaf[k];
      for (int32_t n = 0; n < leaf.width * leaf.height && open && v.status == CLT_OK; n++) {
        const size_t y = (size_t)(leaf.y + n / leaf.width),
                     i = y * (size_t)f->from->width + (size_t)(leaf.x + n % leaf.width);
        look(f, i, &v);
        if (v.status == CLT_OK) {
          each(f, k, i, &v);
        }
      }
    }
    if (v.status != CLT_OK) {
#pragma omp critical
      {
        status = v.status;
        *error = v.error;
      }
    }
    free(v.row);
  }
  return status;
}

static bool is_near(const fit *f, const view *v, size_t i, size_t j) {
  bool near = i == j;
  for (size_t c = 0; c < f->channels; c++) {
    const double apart = v->apart[c * f->cells + j];
    near = near || apart * apart > f->least[c];
  }
  return near;
}

/* Cuts the grid in even leaves, so few that all pairs of them can be kept until the rank is known. */
static clt_status cut_grid(fit *f, clt_error *error) {
  const size_t width = (size_t)f->from->width, height = (size_t)f->from->height;
  size_t side = SIDE_LEAST, across, down;
  do {
    across = (width + side - 1) / side;
    down = (height + side - 1) / side;
    side++;
  } while (TERMS * across * down > NODES_MOST);
  const size_t leaves = across * down;
  clt_status status = clt_hierarchic_begin(f->to, leaves, TERMS * leaves, "a hierarchy", error);
  clt_leaf *leaf = clt_alloc(leaves, sizeof *leaf);
  if (status != CLT_OK || leaf == NULL) {
    free(leaf);
    return status != CLT_OK ? status : clt_fail(error, CLT_FAILED, "no memory for %zu leaves", leaves);
  }
  for (size_t k = 0; k < leaves; k++) {
    const size_t column = k % across, row = k / across, x = column * width / across, y = row * height / down;
    leaf[k] = (clt_leaf){.x = (int32_t)x,
                         .y = (int32_t)y,
                         .width = (int32_t)((column + 1) * width / across - x),
                         .height = (int32_t)((row + 1) * height / down - y)};
  }
  f->own = f->to->storage;
  f->own->leaf = leaf;
  f->nodes = TERMS * leaves;
  return CLT_OK;
}

static void place_cells(fit *f) {
  for (size_t k = 0; k < f->own->leaves; k++) {
    const clt_leaf leaf = f->own->leaf[k];
    for (int32_t n = 0; n < leaf.width * leaf.height; n++) {
      const size_t i = (size_t)(leaf.y + n / leaf.width) * (size_t)f->from->width + (size_t)(leaf.x + n % leaf.width);
      const double u = clt_leaf_place(n % leaf.width, leaf.width), v = clt_leaf_place(n / leaf.width, leaf.height);
      const double term[TERMS] = {1, u, v, u * v};
      memcpy(f->term + TERMS * i, term, sizeof term);
      f->leaf_of[i] = (int32_t)k;
    }
  }
}

static clt_status reserve(fit *f, clt_error *error) {
  const size_t values = f->channels * f->cells, leaves = f->own->leaves, small = f->channels * leaves * TERMS * TERMS;
  const size_t cores = f->channels * f->nodes * f->nodes;
  f->leaf_of = clt_alloc(f->cells, sizeof *f->leaf_of);
  f->term =
      clt_alloc(TERMS * f->cells + 2 * values + 2 * small + 2 * cores + leaves * f->channels * BINS, sizeof *f->term);
  if (f->leaf_of == NULL || f->term == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for a hierarchy of %zu leaves", leaves);
  }
  f->scale = f->term + TERMS * f->cells;
  f->gather = f->scale + values;
  f->inverse_to = f->gather + values;
  f->inverse_from = f->inverse_to + small;
  f->core = f->inverse_from + small;
  f->next = f->core + cores;
  f->energy = f->next + cores;
  return clt_hierarchic_reserve_cells(f->to, error);
}

/* Brings what a cell exchanges with all others to a mean square of 1; the sums of T tell it, without the diagonal. */
static void normalise(double *values, const double *diagonal, size_t cells) {
  double squares = 0;
  for (size_t i = 0; i < cells; i++) {
    values[i] = fmax(values[i] - diagonal[i], 0);
    squares += values[i] * values[i];
  }
  for (size_t i = 0; i < cells && squares > 0; i++) {
    values[i] /= sqrt(squares / (double)cells);
  }
}

/* s, g, and what may be left out: tolerance of the direct light, and the noise that T tells of itself. */
static clt_status measure_cells(fit *f, clt_error *error) {
  double *room = clt_alloc(f->cells, 2 * sizeof *room), *ones = room + f->cells;
  if (room == NULL) {
    return clt_fail(error, CLT_FAILED, "no memory for the diagonal of %zu cells", f->cells);
  }
  for (size_t i = 0; i < f->cells; i++) {
    ones[i] = 1;
  }
  for (size_t c = 0; c < f->channels; c++) {
    const float *sigma = clt_transport_sigma(f->from, (int)c);
    double *scale = f->scale + c * f->cells, *gather = f->gather + c * f->cells;
    f->light[c] = clt_own_light(f->from, (int)c, room);
    clt_transport_diagonal(f->from, (int)c, room);
    clt_transport_row_sums(f->from, (int)c, scale);
    clt_transport_apply_transposed(f->from, (int)c, ones, gather);
    normalise(scale, room, f->cells);
    normalise(gather, room, f->cells);
    for (size_t i = 0; i < f->cells; i++) {
      const double noise = sigma != NULL && isfinite(sigma[i]) ? (double)sigma[i] : 0;
      f->budget[c] += f->tolerance * f->tolerance * room[i] * room[i];
      f->noise[c] += noise * noise * (double)f->cells;
      f->own->scale[c * f->cells + i] = (float)scale[i];
      f->own->gather[c * f->cells + i] = (float)gather[i];
    }
    f->least[c] = INFINITY;
  }
  free(room);
  return CLT_OK;
}

/* A symmetric matrix becomes its inverse by sweeping (Goodnight 1979); what is 0 of it stays 0. */
static void invert(double a[TERMS][TERMS]) {
  const double smallest = SINGULAR * a[0][0];
  for (size_t k = 0; k < TERMS; k++) {
    const double pivot = a[k][k];
    for (size_t j = 0; j < TERMS; j++) {
      a[k][j] = pivot > smallest ? a[k][j] / pivot : 0;
    }
    for (size_t i = 0; i < TERMS; i++) {
      const double by = i != k ? a[i][k] : 0;
      for (size_t j = 0; j < TERMS; j++) {
        a[i][j] -= by * a[k][j];
      }
      a[i][k] = i == k ? a[i][k] : pivot > smallest ? -by / pivot : 0;
    }
    a[k][k] = pivot > smallest ? 1 / pivot : 0;
  }
}

/* The inverses of the moments of the leaves, weighted by the squares of `cells`. */
static void invert_moments(const fit *f, const double *cells, double *inverse) {
  for (size_t at = 0; at < f->channels * f->cells; at++) {
    const size_t c = at / f->cells, i = at % f->cells;
    const double *p = f->term + TERMS * i, squared = cells[at] * cells[at];
    double *moment = inverse + (c * f->own->leaves + (size_t)f->leaf_of[i]) * TERMS * TERMS;
    for (size_t t = 0; t < TERMS * TERMS; t++) {
      moment[t] += squared * p[t / TERMS] * p[t % TERMS];
    }
  }
  for (size_t k = 0; k < f->channels * f->own->leaves; k++) {
    invert((double(*)[TERMS])(void *)(inverse + k * TERMS * TERMS));
  }
}

/* next += s_i p_i (far row of T) diag(g) P, the right side of the fit. */
static void add_row(fit *f, size_t leaf, size_t i, view *v) {
  const double *p = f->term + TERMS * i;
  for (size_t c = 0; c < f->channels; c++) {
    const size_t at = c * f->cells;
    double *next = f->next + (c * f->nodes + TERMS * leaf) * f->nodes;
    memset(v->spread, 0, f->nodes * sizeof *v->spread);
    for (size_t j = 0; j < f->cells; j++) {
      const double far = is_near(f, v, i, j) ? v->row[at + j] - v->apart[at + j] : v->row[at + j];
      const double *u = f->term + TERMS * j, given = f->gather[at + j] * far;
      double *sum = v->spread + TERMS * (size_t)f->leaf_of[j];
      for (size_t t = 0; t < TERMS; t++) {
        sum[t] += given * u[t];
      }
    }
    for (size_t s = 0; s < TERMS; s++) {
      for (size_t m = 0; m < f->nodes; m++) {
        next[s * f->nodes + m] += f->scale[at + i] * p[s] * v->spread[m];
      }
    }
  }
}

/* block = to block from, 4 x 4 within rows of 4L. */
static void solve_pair(const fit *f, const double *to, const double *from, double *block) {
  double half[TERMS][TERMS] = {{0}};
  for (size_t t = 0; t < TERMS * TERMS * TERMS; t++) {
    const size_t s = t / TERMS / TERMS, m = t / TERMS % TERMS, k = t % TERMS;
    half[s][m] += to[s * TERMS + k] * block[k * f->nodes + m];
  }
  for (size_t s = 0; s < TERMS; s++) {
    for (size_t m = 0; m < TERMS; m++) {
      block[s * f->nodes + m] = half[s][0] * from[m] + half[s][1] * from[TERMS + m] + half[s][2] * from[2 * TERMS + m] +
                                half[s][3] * from[3 * TERMS + m];
    }
  }
}

static clt_status fit_core(fit *f, clt_error *error) {
  const size_t leaves = f->own->leaves, small = TERMS * TERMS;
  memset(f->next, 0, f->channels * f->nodes * f->nodes * sizeof *f->next);
  clt_status status = for_rows(f, add_row, error);
  for (size_t k = 0; k < f->channels * leaves * leaves; k++) {
    const size_t c = k / leaves / leaves, a = k / leaves % leaves, b = k % leaves;
    solve_pair(f, f->inverse_to + (c * leaves + a) * small, f->inverse_from + (c * leaves + b) * small,
               f->next + (c * f->nodes + TERMS * a) * f->nodes + TERMS * b);
  }
  double *before = f->core;
  f->core = f->next;
  f->next = before;
  return status;
}

static void sort_row(fit *f, size_t leaf, size_t i, view *v) {
  for (size_t c = 0; c < f->channels; c++) {
    double *energy = f->energy + (leaf * f->channels + c) * BINS;
    for (size_t j = 0; j < f->cells; j++) {
      const double apart = i != j ? v->apart[c * f->cells + j] / f->light[c] : 0;
      int octave;
      const double part = frexp(apart * apart, &octave);
      const int bin = BINS_OCTAVE * (octave + OCTAVES_BELOW) + (int)(2 * BINS_OCTAVE * (part - 0.5));
      energy[bin < 0 || apart == 0 ? 0 : bin < BINS ? bin : BINS - 1] += apart * apart;
    }
  }
}

/* How large an entry beyond M must be to be near, where `share` times the budget may be left out. */
static clt_status choose_near(fit *f, double share, clt_error *error) {
  memset(f->energy, 0, f->own->leaves * f->channels * BINS * sizeof *f->energy);
  const clt_status status = for_rows(f, sort_row, error);
  for (size_t c = 0; c < f->channels; c++) {
    const double light = f->light[c] * f->light[c];
    double left = (share * f->budget[c] + f->noise[c]) / light;
    int bin = 0;
    for (; bin < BINS; bin++) {
      for (size_t leaf = 0; leaf < f->own->leaves; leaf++) {
        left -= f->energy[(leaf * f->channels + c) * BINS + (size_t)bin];
      }
      if (left < 0) {
        break;
      }
    }
    const double edge = 0.5 + 0.5 * (bin % BINS_OCTAVE) / BINS_OCTAVE;
    f->least[c] = bin < BINS ? light * ldexp(edge, bin / BINS_OCTAVE - OCTAVES_BELOW) : INFINITY;
  }
  return status;
}

static void widen(const float *from, size_t count, double *to) {
  for (size_t k = 0; k < count; k++) {
    to[k] = (double)from[k];
  }
}

/* M of a channel as products will have it, left core right'. room holds 3 x 4L x R and R x R. */
static void read_core(fit *f, size_t channel, double *room) {
  const clt_hierarchy_storage *own = f->own;
  const size_t rank = own->rank, factor = f->nodes * rank, first = own->core == NULL ? channel * factor : 0;
  const blasint nodes = (blasint)f->nodes, inner = (blasint)rank;
  double *left = room, *right = room + factor, *turned = room + 2 * factor, *core = room + 3 * factor;
  widen(own->left.value + first, factor, left);
  widen(own->right.value + first, factor, right);
  if (own->core != NULL) {
    widen(own->core + channel * rank * rank, rank * rank, core);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, nodes, inner, inner, 1, left, inner, core, inner, 0, turned,
                inner);
    left = turned;
  }
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, nodes, nodes, inner, 1, left, inner, right, inner, 0,
              f->core + channel * f->nodes * f->nodes, nodes);
}

/* M into factors of least rank, and back as products will have it. */
static clt_status compress(fit *f, clt_error *error) {
  clt_hierarchy_storage *own = f->own;
  const size_t whole = f->nodes * f->nodes;
  double left_out[CLT_CHANNELS_MAX];
  for (size_t k = 0; k < f->channels * whole; k++) {
    own->left.value[k] = (float)f->core[k];
    own->right.value[k] = k % whole / f->nodes == k % f->nodes ? 1 : 0;
  }
  for (size_t c = 0; c < f->channels; c++) {
    left_out[c] = RANK_SHARE * f->tolerance * f->light[c];
  }
  const clt_status status = clt_leaves_compress(own, f->channels, left_out, error);
  double *room = clt_alloc(3 * f->nodes * own->rank + own->rank * own->rank, sizeof *room);
  if (status != CLT_OK || room == NULL) {
    free(room);
    return status != CLT_OK ? status : clt_fail(error, CLT_FAILED, "no memory for far light of rank %zu", own->rank);
  }
  for (size_t c = 0; c < f->channels; c++) {
    read_core(f, c, room);
  }
  free(room);
  return CLT_OK;
}

static void count_row(fit *f, size_t leaf, size_t i, view *v) {
  (void)leaf;
  for (size_t j = 0; j < f->cells; j++) {
    f->own->start[i + 1] += j != i && is_near(f, v, i, j);
  }
}

static void keep_row(fit *f, size_t leaf, size_t i, view *v) {
  (void)leaf;
  clt_hierarchy_storage *own = f->own;
  const size_t entries = (size_t)own->start[f->cells];
  size_t next = (size_t)own->start[i];
  for (size_t j = 0; j < f->cells; j++) {
    if (j != i && is_near(f, v, i, j)) {
      for (size_t c = 0; c < f->channels; c++) {
        own->value[c * entries + next] = (float)v->apart[c * f->cells + j];
      }
      own->cell[next++] = (int32_t)j;
    }
  }
  for (size_t c = 0; c < f->channels; c++) {
    own->own[c * f->cells + i] = (float)v->apart[c * f->cells + i];
  }
}

static clt_status keep_near(fit *f, clt_error *error) {
  clt_status status = for_rows(f, count_row, error);
  for (size_t i = 0; i < f->cells; i++) {
    f->own->start[i + 1] += f->own->start[i];
  }
  const double entries = (double)f->own->start[f->cells], all = (double)f->cells * (double)f->cells;
  if (status == CLT_OK && entries > MOST_NEAR * all) {
    status = clt_fail(error, CLT_BAD_INPUT,
                      "far light of this T does not vary evenly over its grid: %.0f %% of the entries would stand by "
                      "themselves; keep it as it is, or allow a larger error",
                      100 * entries / all);
  }
  if (status == CLT_OK) {
    status = clt_hierarchic_reserve_near(f->to, (size_t)f->own->start[f->cells], error);
  }
  if (status == CLT_OK) {
    status = for_rows(f, keep_row, error);
  }
  return status == CLT_OK ? clt_hierarchic_finish(f->to, (size_t)f->own->start[f->cells], "a hierarchy", error)
                          : status;
}

static clt_status fit_all(fit *f, clt_error *error) {
  clt_status status = cut_grid(f, error);
  if (status == CLT_OK) {
    status = reserve(f, error);
  }
  if (status == CLT_OK) {
    place_cells(f);
    status = measure_cells(f, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  invert_moments(f, f->scale, f->inverse_to);
  invert_moments(f, f->gather, f->inverse_from);
  for (int round = 0; round < ROUNDS && status == CLT_OK; round++) {
    status = fit_core(f, error);
    if (status == CLT_OK && round == ROUNDS - 1) {
      status = compress(f, error);
    }
    if (status == CLT_OK) {
      status = choose_near(f, pow(STRICTER, ROUNDS - 1 - round), error);
    }
  }
  return status == CLT_OK ? keep_near(f, error) : status;
}

clt_status clt_hierarchy_from_rows(const clt_transport *from, double tolerance, clt_transport *to, clt_error *error) {
  fit f = {.from = from, .to = to, .cells = from->cols, .channels = (size_t)from->channels, .tolerance = tolerance};
  const clt_status status = fit_all(&f, error);
  free(f.leaf_of);
  free(f.term);
  return status;
}
