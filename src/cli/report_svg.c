/* The report's drawings: the convergence curve and the colour scale of the error maps. */
#include <math.h>

#include "cli/report.h"

typedef struct axes {
  double left, top, width, height; /* of the plotting area, px */
  int decade_low, decade_high;     /* of the vertical axis */
  size_t last;                     /* iteration at the right end */
} axes;

static double at_x(const axes *a, double iteration) {
  return a->left + a->width * iteration / (double)a->last;
}

static double at_y(const axes *a, double value) {
  double decade = log10(value > 0 ? value : 1e-300);
  double share = (a->decade_high - decade) / (a->decade_high - a->decade_low);
  return a->top + a->height * fmin(fmax(share, 0), 1);
}

static void choose_axes(axes *a, const clt_solve_result *runs, int count) {
  double low = INFINITY, high = 0;
  for (int k = 0; k < count; k++) {
    for (size_t i = 0; i < runs[k].curve_count; i++) {
      double residual = runs[k].curve[i];
      if (isfinite(residual) && residual > 0) {
        low = fmin(low, residual);
        high = fmax(high, residual);
      }
    }
    a->last = runs[k].curve_count > a->last + 1 ? runs[k].curve_count - 1 : a->last;
  }
  a->decade_high = high > 0 ? (int)ceil(log10(high)) : 0;
  a->decade_low = high > 0 ? (int)floor(log10(low)) : -1;
  if (a->decade_low == a->decade_high) {
    a->decade_low--;
  }
}

static void draw_decades(FILE *page, const axes *a) {
  int step = (a->decade_high - a->decade_low + 7) / 8;
  for (int decade = a->decade_high; decade >= a->decade_low; decade -= step) {
    double y = at_y(a, pow(10, decade));
    fprintf(page, "<line class=\"grid\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>", a->left, y,
            a->left + a->width, y);
    fprintf(page,
            "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">10<tspan class=\"power\" dy=\"-5\">%s%d</tspan></text>\n",
            a->left - 8, y + 4, decade < 0 ? "&minus;" : "", decade < 0 ? -decade : decade);
  }
}

static void draw_iterations(FILE *page, const axes *a) {
  static const size_t steps[] = {1, 2, 5, 10, 20, 50, 100, 200};
  size_t step = steps[0];
  for (size_t i = 0; i < sizeof steps / sizeof *steps && a->last / step > 10; i++) {
    step = steps[i];
  }
  for (size_t i = 0; i <= a->last; i += step) {
    fprintf(page, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%zu</text>", at_x(a, (double)i),
            a->top + a->height + 20, i);
  }
  fprintf(page, "\n<text class=\"title\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">iteration</text>\n",
          a->left + a->width / 2, a->top + a->height + 42);
  fprintf(page,
          "<text class=\"title\" transform=\"translate(16 %.1f) rotate(-90)\" text-anchor=\"middle\">relative "
          "residual</text>\n",
          a->top + a->height / 2);
}

static void draw_run(FILE *page, const axes *a, const clt_solve_result *run, int index) {
  fprintf(page, "<g class=\"run r%d\"><polyline points=\"", index % 6);
  for (size_t i = 0; i < run->curve_count; i++) {
    fprintf(page, "%.1f,%.1f ", at_x(a, (double)i), at_y(a, run->curve[i]));
  }
  fputs("\"/>\n", page);
  for (size_t i = 0; i < run->curve_count; i++) {
    fprintf(page, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2.8\"><title>%s, iteration %zu: %.3g</title></circle>",
            at_x(a, (double)i), at_y(a, run->curve[i]), run->method, i, run->curve[i]);
  }
  double y = a->top + 14 + 22 * index, x = a->left + a->width + 24;
  fprintf(page, "\n<polyline points=\"%.1f,%.1f %.1f,%.1f\"/><text x=\"%.1f\" y=\"%.1f\">%s</text></g>\n", x, y - 4,
          x + 26, y - 4, x + 34, y, run->method);
}

void cli_report_curves(FILE *page, const clt_solve_result *runs, int count) {
  axes a = {.left = 74, .top = 14, .width = 540, .height = 230, .last = 1};
  choose_axes(&a, runs, count);
  fputs("<svg class=\"curve\" viewBox=\"0 0 760 300\" role=\"img\" aria-label=\"relative residual against the "
        "iteration\">\n",
        page);
  draw_decades(page, &a);
  draw_iterations(page, &a);
  for (int k = 0; k < count; k++) {
    draw_run(page, &a, &runs[k], k);
  }
  fputs("</svg>\n", page);
}

/* The colour map sampled by painting a ramp with it, so that bar and maps cannot differ. */
static clt_status draw_stops(FILE *page, clt_error *error) {
  enum { STOPS = 33 };
  static const clt_curve srgb = {.kind = CLT_CURVE_SRGB};
  clt_image ramp, colours = {0};
  clt_status status = clt_image_init(&ramp, 1, 1, STOPS, error);
  if (status) {
    return status;
  }
  for (int i = 0; i < STOPS; i++) {
    ramp.data[i] = (float)i / (STOPS - 1);
  }
  status = clt_image_heatmap(&ramp, 1, &colours, error);
  for (int i = 0; !status && i < STOPS; i++) {
    int code[3];
    for (int c = 0; c < 3; c++) {
      code[c] = (int)lround(255 * clt_curve_encode(&srgb, colours.data[c * STOPS + i]));
    }
    fprintf(page, "<stop offset=\"%.4f\" stop-color=\"#%02x%02x%02x\"/>", (double)i / (STOPS - 1), code[0], code[1],
            code[2]);
  }
  clt_image_finish(&ramp);
  clt_image_finish(&colours);
  return status;
}

clt_status cli_report_scale(FILE *page, double top, clt_error *error) {
  fputs("<svg class=\"scale\" viewBox=\"0 0 700 62\" role=\"img\" aria-label=\"colour scale of the error "
        "maps\"><defs><linearGradient id=\"scale\">",
        page);
  clt_status status = draw_stops(page, error);
  fputs("</linearGradient></defs><rect x=\"30\" y=\"2\" width=\"640\" height=\"16\" rx=\"3\" fill=\"url(#scale)\"/>\n",
        page);
  for (int i = 0; i <= 4; i++) {
    fprintf(page, "<text x=\"%d\" y=\"36\" text-anchor=\"middle\">%.3g&nbsp;%%</text>", 30 + 160 * i, 25 * i * top);
  }
  fputs("<text x=\"350\" y=\"56\" text-anchor=\"middle\">difference from the target, as a share of white</text>\n",
        page);
  fputs("</svg>\n", page);
  return status;
}
