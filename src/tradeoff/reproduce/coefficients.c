/* Table 1 and Figs. 5 and 6: the coefficients of S_n^-1 and S_n^-1 S in powers of A, by expanding eq. 22 with integers,
 * beside the closed forms (eqs. 33, 34) and the report's own table. */
#include <stdint.h>
#include <stdlib.h>

#include "tradeoff/reproduce/figures.h"

enum { TERMS = 12, POWERS = 7 };

typedef struct polynomial {
  int64_t of[POWERS + 1]; /* coefficient of A^m */
} polynomial;

/* Table 1 as printed: rows n = 0..7, columns A^0..A^7. */
static const polynomial printed_inverse[] = {{{1, 0, 0, 0, 0, 0, 0, 0}},   {{1, -1, -1, -1, -1, -1, -1, -1}},
                                             {{1, -1, 0, 1, 2, 3, 4, 5}},  {{1, -1, 0, 0, -1, -3, -6, -10}},
                                             {{1, -1, 0, 0, 0, 1, 4, 10}}, {{1, -1, 0, 0, 0, 0, -1, -5}},
                                             {{1, -1, 0, 0, 0, 0, 0, 1}},  {{1, -1, 0, 0, 0, 0, 0, 0}}};
static const polynomial printed_product[] = {{{1, 1, 1, 1, 1, 1, 1, 1}},   {{1, 0, -1, -2, -3, -4, -5, -6}},
                                             {{1, 0, 0, 1, 3, 6, 10, 15}}, {{1, 0, 0, 0, -1, -4, -10, -20}},
                                             {{1, 0, 0, 0, 0, 1, 5, 15}},  {{1, 0, 0, 0, 0, 0, -1, -6}},
                                             {{1, 0, 0, 0, 0, 0, 0, 1}},   {{1, 0, 0, 0, 0, 0, 0, 0}}};
enum { PRINTED = sizeof printed_inverse / sizeof printed_inverse[0] };

/* a b, cut off after A^POWERS. */
static polynomial multiply(const polynomial *a, const polynomial *b) {
  polynomial product = {{0}};
  for (int i = 0; i <= POWERS; i++) {
    for (int j = 0; i + j <= POWERS; j++) {
      product.of[i + j] += a->of[i] * b->of[j];
    }
  }
  return product;
}

static int64_t binomial(int upper, int lower) {
  if (lower < 0 || lower > upper) {
    return 0;
  }
  int64_t value = 1;
  for (int k = 1; k <= lower; k++) {
    value = value * (upper - lower + k) / k;
  }
  return value;
}

/* Eq. 33, for n >= 1. */
static int64_t closed_inverse(int n, int m) {
  int64_t sign = n % 2 == 0 ? 1 : -1;
  return m == 0 ? 1 : m == 1 ? -1 : m > n ? sign * binomial(m - 2, n - 1) : 0;
}

/* Eq. 34, for n >= 0. */
static int64_t closed_product(int n, int m) {
  int64_t sign = n % 2 == 0 ? 1 : -1;
  return m == 0 ? 1 : m > n ? sign * binomial(m - 1, n) : 0;
}

/* Expands S_n^-1 (eq. 22) and S_n^-1 S for n = 0..TERMS. */
static void expand(polynomial inverse[TERMS + 1], polynomial product[TERMS + 1]) {
  polynomial light = {{0}}, reflected = {{0}}, power = {{1}}, sum = {{0}};
  for (int m = 0; m <= POWERS; m++) {
    light.of[m] = 1;         /* S = 1 + A + A^2 ... */
    reflected.of[m] = m > 0; /* R = S - 1 */
  }
  for (int n = 0; n <= TERMS; n++) {
    for (int m = 0; m <= POWERS; m++) {
      sum.of[m] += n % 2 == 0 ? power.of[m] : -power.of[m];
    }
    inverse[n] = sum;
    product[n] = multiply(&sum, &light);
    power = multiply(&power, &reflected);
  }
}

static void draw(clt_chart *chart, const polynomial *of) {
  for (int m = 0; m <= POWERS; m++) {
    clt_chart_line *line = clt_chart_add(chart, "A^%d", m);
    for (int n = 0; n <= TERMS; n++) {
      clt_chart_point(line, n, (double)of[n].of[m]);
    }
  }
}

static clt_status compute(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  polynomial inverse[TERMS + 1], product[TERMS + 1];
  int equal = 0, closed = 0, shown = 2 * PRINTED * (POWERS + 1), formulas = 2 * (TERMS + 1) * (POWERS + 1);
  expand(inverse, product);
  for (int n = 0; n <= TERMS; n++) {
    for (int m = 0; m <= POWERS; m++) {
      closed += (n == 0 ? inverse[n].of[m] == (m == 0) : inverse[n].of[m] == closed_inverse(n, m));
      closed += product[n].of[m] == closed_product(n, m);
      equal += n < PRINTED && inverse[n].of[m] == printed_inverse[n].of[m];
      equal += n < PRINTED && product[n].of[m] == printed_product[n].of[m];
    }
  }
  clt_reproduced_add(out, "Table 1", "coefficients of S_n^-1 and S_n^-1 S, m and n up to 7", equal == shown,
                     "%d of %d printed numbers are equal", equal, shown);
  clt_reproduced_add(out, "Figs. 5, 6", "the same up to n = 12; closed forms, eqs. 33 and 34", closed == formulas,
                     "%d of %d expanded coefficients equal the closed forms", closed, formulas);
  clt_chart figure = {.title = "Coefficients of S_n^-1", .across = "terms n", .up = "coefficient"};
  draw(&figure, inverse);
  clt_status status = clt_chart_write(&figure, options->folder, "fig5", error);
  figure = (clt_chart){.title = "Coefficients of S_n^-1 S", .across = "terms n", .up = "coefficient"};
  draw(&figure, product);
  return status == CLT_OK ? clt_chart_write(&figure, options->folder, "fig6", error) : status;
}

const clt_figure clt_figure_coefficients = {
    .name = "Table 1, Figs. 5 and 6",
    .caption = "Coefficients of the inverse series in powers of A: each term cancels a bounce.",
    .files = {{"fig5.svg", "Fig. 5: coefficients of S_n^-1.", false},
              {"fig6.svg", "Fig. 6: coefficients of S_n^-1 S.", false}},
    .compute = compute};
