/* Fig. 8: how the inverse series converges in the box. Its error after n terms is
 * (S_n^-1 - S^-1) l_out = (-1)^n A^(n+1) S^n l_out, which is followed here by products with R = S - I. */
#include <cblas.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "tradeoff/reproduce/cube.h"
#include "tradeoff/reproduce/figures.h"

enum { DIVISION = 12, TERMS = 40 };

/* A box of one albedo, and room for its vectors. */
typedef struct box {
  clt_cube cube;
  double *direct, *estimate, *correction, *lit; /* cells values each */
  double *light;                                /* S */
} box;

static clt_status box_init(box *of, int sides, int division, clt_error *error) {
  *of = (box){0};
  clt_status status = clt_cube_init(&of->cube, sides, division, division, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t cells = of->cube.cells;
  of->direct = clt_alloc(4 * cells, sizeof *of->direct);
  of->light = clt_alloc(cells * cells, sizeof *of->light);
  if (of->direct == NULL || of->light == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for the vectors of %zu patches", cells);
  }
  of->estimate = of->direct + cells;
  of->correction = of->estimate + cells;
  of->lit = of->correction + cells;
  return CLT_OK;
}

static void box_finish(box *of) {
  clt_cube_finish(&of->cube);
  free(of->direct);
  free(of->light);
}

/* lit = S x */
static void illuminate(const box *of, const double *x, double *lit) {
  blasint cells = (blasint)of->cube.cells;
  cblas_dgemv(CblasRowMajor, CblasNoTrans, cells, cells, 1.0, of->light, cells, x, 1, 0.0, lit, 1);
}

/* Paints every side, and begins the series at S_0^-1 l_out = l_out = S l_d, with l_d the light of each side. */
static clt_status begin(box *of, double albedo, const double light[CLT_CUBE_SIDES], clt_error *error) {
  const double all[CLT_CUBE_SIDES] = {albedo, albedo, albedo, albedo, albedo, albedo};
  size_t cells = of->cube.cells, each = cells / (size_t)of->cube.sides;
  clt_status status = clt_cube_solve(&of->cube, all, of->light, error);
  if (status == CLT_OK) {
    for (size_t i = 0; i < cells; i++) {
      of->direct[i] = light[i / each];
    }
    illuminate(of, of->direct, of->estimate);
    memcpy(of->correction, of->estimate, cells * sizeof *of->correction);
  }
  return status;
}

/* Adds the next term, (-R)^n l_out, from the one before: -R x = x - S x. */
static void add_term(box *of) {
  illuminate(of, of->correction, of->lit);
  for (size_t i = 0; i < of->cube.cells; i++) {
    of->correction[i] -= of->lit[i];
    of->estimate[i] += of->correction[i];
  }
}

static double largest_error(const box *of) {
  double most = 0.0;
  for (size_t i = 0; i < of->cube.cells; i++) {
    most = fmax(most, fabs(of->estimate[i] - of->direct[i]));
  }
  return most;
}

/* ||e|| / ||l_d|| */
static double relative_error(const box *of) {
  double error = 0.0, whole = 0.0;
  for (size_t i = 0; i < of->cube.cells; i++) {
    error += (of->estimate[i] - of->direct[i]) * (of->estimate[i] - of->direct[i]);
    whole += of->direct[i] * of->direct[i];
  }
  return sqrt(error / whole);
}

/* The l_d of Fig. 7: constant on each side. */
static const double figure_light[CLT_CUBE_SIDES] = {0.7, 0.4, 0.9, 0.5, 0.8, 0.3};

/* Fig. 8a: the error at the middle of the floor, at its edge and in its corner. */
static clt_status points(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  static const struct {
    const char *name;
    int patch;
  } at[] = {{"center", DIVISION / 2 * DIVISION + DIVISION / 2}, {"edge", DIVISION / 2}, {"corner", 0}};
  clt_chart chart = {.title = "Error of the inverse series at one point (closed box, albedo 0.4)",
                     .across = "terms n",
                     .up = "error relative to the brightest direct light"};
  box room;
  clt_status status = box_init(&room, 6, DIVISION, error);
  bool alternates = true;
  double rate[3] = {0}, before[3] = {0};
  if (status == CLT_OK) {
    status = begin(&room, 0.4, figure_light, error);
  }
  if (status == CLT_OK) {
    for (int p = 0; p < 3; p++) {
      clt_chart_add(&chart, "%s", at[p].name);
    }
    for (int n = 0; n <= 20; n++) {
      for (int p = 0; p < 3; p++) {
        double value = room.estimate[at[p].patch] - room.direct[at[p].patch];
        alternates = alternates && (n == 0 || value * before[p] < 0.0);
        rate[p] = n > 0 ? fabs(value / before[p]) : 0.0;
        before[p] = value;
        clt_chart_point(&chart.lines[p], n, value / 0.9);
      }
      add_term(&room);
    }
    double spread = fmax(fmax(rate[0], rate[1]), rate[2]) / fmin(fmin(rate[0], rate[1]), rate[2]) - 1.0;
    clt_reproduced_add(out, "Fig. 8a", "oscillates; corners, edges and face centers converge in largely similar ways",
                       alternates && spread < 0.02,
                       "the sign %s with every term; a term leaves %.3f, %.3f and %.3f of the error (center, edge, "
                       "corner; m/(1-m) = %.3f)",
                       alternates ? "alternates" : "does not alternate", rate[0], rate[1], rate[2], 0.4 / 0.6);
    status = clt_chart_write(&chart, options->folder, "fig8a", error);
  }
  box_finish(&room);
  return status;
}

/* Fig. 8b: S_n^-1 - S^-1 has one sign throughout, so its norm (largest row sum) is what it makes of even light. */
static clt_status bounds(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  static const double albedos[] = {0.3, 0.4, 0.45};
  clt_chart chart = {
      .title = "Error of the whole operator against eq. 39", .across = "terms n", .up = "norm", .log_up = true};
  box room;
  clt_status status = box_init(&room, 6, DIVISION, error);
  double worst = 0.0, sharp = 0.0;
  for (size_t k = 0; status == CLT_OK && k < sizeof albedos / sizeof albedos[0]; k++) {
    double m = albedos[k];
    clt_chart_line *found = clt_chart_add(&chart, "albedo %g", m);
    clt_chart_line *bound = clt_chart_add(&chart, "eq. 39 for %g", m);
    bound->colour = found->colour;
    bound->dashed = true;
    /* S^-1 1 = (1 - m) 1 in the closed box: the light whose S is even */
    const double even[CLT_CUBE_SIDES] = {1 - m, 1 - m, 1 - m, 1 - m, 1 - m, 1 - m};
    status = begin(&room, m, even, error);
    for (int n = 0; n <= 20 && status == CLT_OK; n++) {
      double norm = largest_error(&room), eq39 = pow(m, n + 1) / (pow(1 - m, n) * (1 - 2 * m));
      worst = fmax(worst, fabs(norm / eq39 / (1 - 2 * m) - 1.0));
      sharp = fmax(sharp, fabs(norm / (pow(m, n + 1) / pow(1 - m, n)) - 1.0));
      clt_chart_point(found, n, norm);
      clt_chart_point(bound, n, eq39);
      add_term(&room);
    }
  }
  box_finish(&room);
  clt_reproduced_add(out, "Fig. 8b", "excellent agreement with eq. 39, loose only by a constant factor", worst < 1e-6,
                     "the factor is 1 - 2m to %.0e at every n; m^(n+1)/(1-m)^n is attained to %.0e", worst, sharp);
  return status == CLT_OK ? clt_chart_write(&chart, options->folder, "fig8b", error) : status;
}

/* Follows TERMS terms for one room that has begun; the rate is what the last one leaves. Returns the terms to 1e-3, or
 * -1. *rate was zeroed by the caller. */
static int follow(box *room, clt_chart_line *line, double *rate) {
  int needed = -1;
  double last = 0.0;
  for (int n = 0; n <= TERMS; n++) {
    double now = relative_error(room);
    *rate = last > 0.0 && now > 1e-12 ? now / last : *rate; /* below is rounding */
    last = now;
    clt_chart_point(line, n, now);
    needed = needed < 0 && now <= 1e-3 ? n : needed;
    add_term(room);
  }
  return needed;
}

/* Fig. 8c: several albedos in the closed box. */
static clt_status albedos(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  static const double tried[] = {0.1, 0.2, 0.3, 0.4, 0.45, 0.49, 0.51};
  enum { COUNT = sizeof tried / sizeof tried[0] };
  clt_chart chart = {.title = "Albedo in a closed box", .across = "terms n", .up = "relative error", .log_up = true};
  double rate[COUNT] = {0}, after_20 = 0.0;
  int needed[COUNT] = {0};
  box room;
  clt_status status = box_init(&room, 6, DIVISION, error);
  for (int k = 0; status == CLT_OK && k < COUNT; k++) {
    clt_chart_line *line = clt_chart_add(&chart, "albedo %g", tried[k]);
    status = begin(&room, tried[k], figure_light, error);
    needed[k] = status == CLT_OK ? follow(&room, line, &rate[k]) : 0;
    after_20 = tried[k] == 0.45 ? line->y[20] : after_20;
  }
  box_finish(&room);
  clt_reproduced_add(out, "Fig. 8c, below 0.5", "faster for lower albedos; at 0.45 at most 10-20 terms suffice",
                     needed[0] < needed[1] && needed[1] < needed[2] && needed[2] < needed[3] && after_20 < 0.02,
                     "%d, %d, %d, %d, %d terms to 0.1 %% at albedo .1 .2 .3 .4 .45; 20 terms leave %.1f %% at .45",
                     needed[0], needed[1], needed[2], needed[3], needed[4], 100 * after_20);
  clt_reproduced_add(out, "Fig. 8c, at 0.5", "very slow close to 0.5; 0.51 diverges",
                     rate[COUNT - 2] < 1.0 && rate[COUNT - 2] > 0.95 && rate[COUNT - 1] > 1.0,
                     "a term leaves %.3f of the error at .49 and makes %.3f of it at .51", rate[COUNT - 2],
                     rate[COUNT - 1]);
  return status == CLT_OK ? clt_chart_write(&chart, options->folder, "fig8c", error) : status;
}

/* What a term leaves when the report's own F = diag(T) stands for the first bounce: rho(S diag(S)^-1 - I). */
static clt_status rate_with_diagonal(int sides, int division, double albedo, double *rate, clt_error *error) {
  clt_cube cube = {0};
  double all[CLT_CUBE_SIDES] = {albedo, albedo, albedo, albedo, albedo, albedo};
  clt_status status = clt_cube_init(&cube, sides, division, division, error);
  size_t cells = cube.cells;
  double *light = status == CLT_OK ? clt_alloc(cells * cells + 2 * cells, sizeof *light) : NULL;
  if (status == CLT_OK && light == NULL) {
    status = clt_fail(error, CLT_FAILED, "not enough memory for a box of %zu patches", cells);
  }
  if (status == CLT_OK) {
    status = clt_cube_solve(&cube, all, light, error);
  }
  for (size_t i = 0; status == CLT_OK && i < cells; i++) {
    light[cells * cells + i] = 1.0;
  }
  for (int step = 0; status == CLT_OK && step < 60; step++) {
    double *x = light + cells * cells, *y = x + cells;
    *rate = 0.0;
    for (size_t i = 0; i < cells; i++) {
      y[i] = -x[i];
      for (size_t j = 0; j < cells; j++) {
        y[i] += light[i * cells + j] / light[j * cells + j] * x[j];
      }
      *rate = fmax(*rate, y[i]);
    }
    for (size_t i = 0; i < cells; i++) {
      x[i] = y[i] / *rate;
    }
  }
  free(light);
  clt_cube_finish(&cube);
  return status;
}

/* Fig. 8d: albedo 0.62 with fewer sides. */
static clt_status open_boxes(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_chart chart = {.title = "Albedo 0.62 in open boxes", .across = "terms n", .up = "relative error", .log_up = true};
  double rate[CLT_CUBE_SIDES + 1] = {0}, coarse = 0.0;
  clt_status status = CLT_OK;
  for (int sides = 6; status == CLT_OK && sides >= 2; sides--) {
    box room;
    status = box_init(&room, sides, DIVISION, error);
    if (status == CLT_OK) {
      status = begin(&room, 0.62, figure_light, error);
    }
    if (status == CLT_OK) {
      follow(&room, clt_chart_add(&chart, "%d sides", sides), &rate[sides]);
    }
    box_finish(&room);
  }
  if (status == CLT_OK) {
    status = rate_with_diagonal(5, 4, 0.62, &coarse, error);
  }
  clt_reproduced_add(out, "Fig. 8d, 6 sides", "0.62 diverges in a closed box", rate[6] > 1.0,
                     "a term makes %.3f of the error", rate[6]);
  clt_reproduced_add(out, "Fig. 8d, 5 sides", "very slow convergence", coarse < 1.0 && coarse > 0.9,
                     "slow (%.3f of the error is left) with the report's 80 patches and F = diag(T); %.3f, past the "
                     "threshold of albedo .610, with %d x %d patches a side and the true F",
                     coarse, rate[5], DIVISION, DIVISION);
  clt_reproduced_add(out, "Fig. 8d, 4 to 2 sides", "rapid convergence",
                     rate[4] < 0.8 && rate[3] < rate[4] && rate[2] < rate[3],
                     "a term leaves %.3f, %.3f, %.3f of the error with 4, 3, 2 sides", rate[4], rate[3], rate[2]);
  return status == CLT_OK ? clt_chart_write(&chart, options->folder, "fig8d", error) : status;
}

static clt_status compute(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_status (*const parts[])(const clt_reproduce_options *, clt_reproduction *, clt_error *) = {points, bounds,
                                                                                                 albedos, open_boxes};
  clt_status status = CLT_OK;
  for (size_t k = 0; status == CLT_OK && k < sizeof parts / sizeof parts[0]; k++) {
    status = parts[k](options, out, error);
  }
  return status;
}

const clt_figure clt_figure_convergence = {
    .name = "Fig. 8",
    .caption = "How the inverse series (eq. 16) converges in a box: at single points, as an operator against its "
               "bound, for several albedos, and with sides taken away.",
    .files = {{"fig8a.svg", "Fig. 8a: the error at three points of the floor.", false},
              {"fig8b.svg", "Fig. 8b: the norm of S_n^-1 - S^-1, and eq. 39's bound.", false},
              {"fig8c.svg", "Fig. 8c: albedos in a closed box.", false},
              {"fig8d.svg", "Fig. 8d: albedo 0.62 in boxes with sides taken away.", false}},
    .compute = compute};
