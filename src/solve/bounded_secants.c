/* The quadratic model of the bounded solve and its minimum within the box, at no product with T. */
#include <lapacke.h>
#include <math.h>

#include "solve/bounded.h"

static const double NOTHING_NEW = 1e-10; /* of ||S d||^2: a step that the model knew already */
enum { SET_CHANGES = 25, ROUND = 2 * CLT_SECANTS };

void clt_secants_open(clt_secants *model, const clt_box *box, size_t first) {
  model->box = box;
  model->count = 0;
  model->sigma = 1; /* S has a diagonal of 1 */
  model->slope = clt_system_vector(box->system, first);
  model->rest = clt_system_vector(box->system, first + 1);
  model->open = clt_system_vector(box->system, first + 2);
  model->counted = clt_system_vector(box->system, first + 3);
  for (size_t k = 0; k < CLT_SECANTS; k++) {
    model->v[k] = clt_system_vector(box->system, first + 4 + k);
    model->y[k] = clt_system_vector(box->system, first + 4 + CLT_SECANTS + k);
  }
}

static void forget_oldest(clt_secants *model) {
  double *v = model->v[0], *y = model->y[0];
  for (int k = 1; k < CLT_SECANTS; k++) {
    model->v[k - 1] = model->v[k];
    model->y[k - 1] = model->y[k];
    for (int i = 1; i < CLT_SECANTS; i++) {
      model->gram[k - 1][i - 1] = model->gram[k][i];
    }
  }
  model->v[CLT_SECANTS - 1] = v;
  model->y[CLT_SECANTS - 1] = y;
  model->count--;
}

/* The part of d that is H-conjugate to V: with c = Y'd it is d - V c, and H makes H d - Y c of it; its curvature is
 * ||S d||^2 - ||c||^2. */
void clt_secants_learn(clt_secants *model) {
  const clt_box *box = model->box;
  size_t cols = box->system->cols;
  if (model->count == CLT_SECANTS) {
    forget_oldest(model);
  }
  int k = model->count;
  double *v = model->v[k], *y = model->y[k];
  double whole = clt_dot(box->system->rows, box->image, box->image), curvature = whole;
  clt_copy(cols, box->direction, v);
  clt_copy(cols, box->curved, y);
  for (int i = 0; i < k; i++) {
    double c = clt_dot(cols, model->y[i], box->direction);
    clt_add(cols, -c, model->v[i], v);
    clt_add(cols, -c, model->y[i], y);
    curvature -= c * c;
  }
  if (!(curvature > NOTHING_NEW * whole)) {
    return;
  }
  cblas_dscal((blasint)cols, 1 / sqrt(curvature), v, 1);
  cblas_dscal((blasint)cols, 1 / sqrt(curvature), y, 1);
  for (int i = 0; i <= k; i++) {
    model->gram[i][k] = model->gram[k][i] = clt_dot(cols, model->v[i], v);
  }
  model->sigma = fmin(1, 1 / model->gram[k][k]);
  model->count++;
}

/* Solves V'V c = c in place. */
static bool solve_gram(const clt_secants *model, double *c) {
  double gram[CLT_SECANTS * CLT_SECANTS];
  for (int i = 0; i < model->count; i++) {
    clt_copy((size_t)model->count, model->gram[i], gram + i * model->count);
  }
  return model->count == 0 ||
         LAPACKE_dposv(LAPACK_COL_MAJOR, 'L', model->count, 1, gram, model->count, c, model->count) == 0;
}

/* out = g + B d; false where V has lost its rank. */
static bool model_slope(const clt_secants *model, const double *d, double *out) {
  const clt_box *box = model->box;
  size_t cols = box->system->cols;
  double c[CLT_SECANTS];
  for (int k = 0; k < model->count; k++) {
    c[k] = clt_dot(cols, model->v[k], d);
  }
  if (!solve_gram(model, c)) {
    return false;
  }
  clt_copy(cols, box->gradient, out);
  clt_add(cols, model->sigma, d, out);
  for (int k = 0; k < model->count; k++) {
    clt_add(cols, -model->sigma * c[k], model->v[k], out);
    clt_add(cols, clt_dot(cols, model->y[k], d), model->y[k], out);
  }
  return true;
}

/* Takes cells into `whole` or out of it: those that are free and not counted, or counted and not free. */
static void recount(clt_secants *model, bool in) {
  size_t cols = model->box->system->cols, j = 0;
  const double before = in ? 0 : 1, now = in ? 1 : 0;
  int order = 2 * model->count;
  while (j < cols) {
    int cells = 0;
    for (; j < cols && cells < CLT_SECANT_CELLS; j++) {
      if (model->counted[j] != before || model->open[j] != now) {
        continue;
      }
      model->counted[j] = now;
      double *packed = model->packed + cells++ * order;
      for (int k = 0; k < model->count; k++) {
        packed[k] = model->v[k][j];
        packed[model->count + k] = model->y[k][j];
      }
    }
    if (cells > 0) {
      cblas_dsyrk(CblasColMajor, CblasUpper, CblasNoTrans, order, cells, in ? 1 : -1, model->packed, order, 1,
                  model->whole, order);
    }
  }
}

/* U'U over the free cells, from what it was for the last set; the vectors stay the same. */
static void free_products(clt_secants *model) {
  if (model->count > 0) {
    recount(model, false);
    recount(model, true);
  }
  memcpy(model->small, model->whole, sizeof model->small);
}

/* rest = B_ff^-1 rest on the free cells, where rest is 0 on the others. By Woodbury's identity, with U = [V Y] there,
 *
 *   B_ff^-1 = (I - U M^-1 U') / sigma,   M = U'U + [-V'V 0; 0 sigma I],   V'V over all cells. */
static bool solve_free(clt_secants *model) {
  size_t cols = model->box->system->cols;
  int count = model->count, order = 2 * count;
  double z[ROUND];
  lapack_int pivots[ROUND];
  free_products(model);
  for (int k = 0; k < count; k++) {
    for (int i = 0; i <= k; i++) {
      model->small[k * order + i] -= model->gram[k][i];
    }
    model->small[(count + k) * order + count + k] += model->sigma;
    z[k] = clt_dot(cols, model->v[k], model->rest);
    z[count + k] = clt_dot(cols, model->y[k], model->rest);
  }
  if (order > 0 && LAPACKE_dsysv(LAPACK_COL_MAJOR, 'U', order, 1, model->small, order, pivots, z, order) != 0) {
    return false;
  }
  for (int k = 0; k < count; k++) {
    clt_add(cols, -z[k], model->v[k], model->rest);
    clt_add(cols, -z[count + k], model->y[k], model->rest);
  }
  for (size_t j = 0; j < cols; j++) {
    model->rest[j] = model->open[j] != 0 ? model->rest[j] / model->sigma : 0;
  }
  return true;
}

/* Holds the cells that d - (g + B d) takes to a bound, at that bound; counts those that have changed sides. */
static size_t choose_set(clt_secants *model, double *d) {
  const clt_box *box = model->box;
  size_t changed = 0;
  for (size_t j = 0; j < box->system->cols; j++) {
    double low = -box->light[j], high = clt_box_top(box, j) - box->light[j], wanted = d[j] - model->slope[j];
    bool held = wanted <= low || wanted >= high;
    changed += (model->open[j] == 0) != held;
    model->open[j] = held ? 0 : 1;
    d[j] = wanted <= low ? low : held ? high : 0;
  }
  return changed;
}

/* Primal-dual active sets (Hintermueller, Ito & Kunisch 2002; BOXCQP of Voglis & Lagaris 2004 is the same): the cells
 * at a bound are held there, the others solve B_ff d_f = -(g + B d_held)_f, and the multipliers choose the next set. */
bool clt_secants_minimise(clt_secants *model) {
  const clt_box *box = model->box;
  size_t cols = box->system->cols;
  double *d = box->direction;
  memset(d, 0, cols * sizeof *d);
  memset(model->counted, 0, cols * sizeof *model->counted);
  memset(model->whole, 0, sizeof model->whole);
  clt_copy(cols, box->gradient, model->slope);
  for (int change = 0; change < SET_CHANGES; change++) {
    size_t changed = choose_set(model, d);
    if (!model_slope(model, d, model->slope)) {
      return false;
    }
    for (size_t j = 0; j < cols; j++) {
      model->rest[j] = model->open[j] != 0 ? -model->slope[j] : 0;
    }
    if (!solve_free(model)) {
      return false;
    }
    clt_add(cols, 1, model->rest, d);
    if (change > 0 && changed == 0) {
      return true;
    }
    if (!model_slope(model, d, model->slope)) {
      return false;
    }
  }
  return false;
}
