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

static void choose_decades(axes *a, const double *residuals, size_t count) {
  double low = INFINITY, high = 0;
  for (size_t i = 0; i < count; i++) {
    if (isfinite(residuals[i]) && residuals[i] > 0) {
      low = fmin(low, residuals[i]);
      high = fmax(high, residuals[i]);
    }
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

void cli_report_curve(FILE *page, const double *residuals, size_t count) {
  axes a = {.left = 74, .top = 14, .width = 606, .height = 230, .last = count > 1 ? count - 1 : 1};
  choose_decades(&a, residuals, count);
  fputs("<svg class=\"curve\" viewBox=\"0 0 700 300\" role=\"img\" aria-label=\"relative residual against the "
        "iteration\">\n",
        page);
  draw_decades(page, &a);
  draw_iterations(page, &a);
  fputs("<polyline points=\"", page);
  for (size_t i = 0; i < count; i++) {
    fprintf(page, "%.1f,%.1f ", at_x(&a, (double)i), at_y(&a, residuals[i]));
  }
  fputs("\"/>\n", page);
  for (size_t i = 0; count <= 60 && i < count; i++) {
    fprintf(page, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3.2\"><title>iteration %zu: %.3g</title></circle>",
            at_x(&a, (double)i), at_y(&a, residuals[i]), i, residuals[i]);
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
  fputs("</linearGradient></defs><rect x=\"20\" y=\"2\" width=\"660\" height=\"16\" rx=\"3\" fill=\"url(#scale)\"/>\n",
        page);
  for (int i = 0; i <= 4; i++) {
    fprintf(page, "<text x=\"%d\" y=\"36\" text-anchor=\"middle\">%.3g&nbsp;%%</text>", 20 + 165 * i, 25 * i * top);
  }
  fputs("<text x=\"350\" y=\"56\" text-anchor=\"middle\">difference from the target, as a share of white</text>\n",
        page);
  fputs("</svg>\n", page);
  return status;
}
