/* The drawings of calibrate's report: response curves and the histogram of latencies. */
#include <math.h>

#include "cli/calibrate_report.h"

#define LEFT 64.0
#define TOP 18.0
#define WIDTH 560.0
#define HEIGHT 330.0
enum { STEPS = 64 };

static void begin(FILE *page, const char *across, const char *up) {
  fputs("<svg viewBox=\"0 0 800 410\" role=\"img\">\n", page);
  fprintf(page, "<text class=\"title\" x=\"%.0f\" y=\"%.0f\" text-anchor=\"middle\">%s</text>\n", LEFT + WIDTH / 2,
          TOP + HEIGHT + 44, across);
  fprintf(page, "<text class=\"title\" transform=\"translate(16 %.0f) rotate(-90)\" text-anchor=\"middle\">%s</text>\n",
          TOP + HEIGHT / 2, up);
}

static double at_y(double share) {
  return TOP + HEIGHT * (1 - fmin(fmax(share, 0), 1));
}

static void grid_line(FILE *page, double share, const char *format, double label) {
  fprintf(page, "<line class=\"grid\" x1=\"%.0f\" x2=\"%.0f\" y1=\"%.1f\" y2=\"%.1f\"/><text x=\"%.0f\" y=\"%.1f\" ",
          LEFT, LEFT + WIDTH, at_y(share), at_y(share), LEFT - 8, at_y(share) + 4);
  fputs("text-anchor=\"end\">", page);
  fprintf(page, format, label);
  fputs("</text>\n", page);
}

static void tick(FILE *page, double share, const char *format, double label) {
  fprintf(page, "<text x=\"%.1f\" y=\"%.0f\" text-anchor=\"middle\">", LEFT + WIDTH * share, TOP + HEIGHT + 20);
  fprintf(page, format, label);
  fputs("</text>\n", page);
}

/* A named curve; the name stands at the right, at line `place`. */
static void draw_curve(FILE *page, const clt_curve *curve, const char *colour, double width, const char *name,
                       int place) {
  const char *dash = width < 1.5 ? ";stroke-dasharray:5 4" : "";
  fprintf(page, "<polyline style=\"stroke:%s;stroke-width:%.1f%s\" points=\"", colour, width, dash);
  for (int k = 0; k <= STEPS; k++) {
    double code = (double)k / STEPS;
    fprintf(page, "%.1f,%.1f ", LEFT + WIDTH * code, at_y(clt_curve_decode(curve, code)));
  }
  double y = TOP + 14 + 22 * place;
  fprintf(page, "\"/><line style=\"stroke:%s;stroke-width:%.1f%s\" x1=\"640\" x2=\"664\" y1=\"%.0f\" y2=\"%.0f\"/>",
          colour, width, dash, y - 4, y - 4);
  fprintf(page, "<text x=\"672\" y=\"%.0f\">%s</text>\n", y, name);
}

void cli_draw_responses(FILE *page, const clt_calibration_info *info) {
  static const char *const colours[] = {"#dc4a3d", "#2a9d5c", "#3b82f6"};
  static const char *const names[] = {"projector red", "projector green", "projector blue"};
  const clt_curve srgb = {.kind = CLT_CURVE_SRGB}, linear = {.kind = CLT_CURVE_LINEAR};
  begin(page, "code, of full scale", "light, of full scale");
  for (int k = 0; k <= 4; k++) {
    grid_line(page, k / 4.0, "%.2f", k / 4.0);
    tick(page, k / 4.0, "%.2f", k / 4.0);
  }
  for (int c = 0; c < info->channels; c++) {
    draw_curve(page, &info->panel.response[c], info->channels > 1 ? colours[c] : "var(--ink)", 2.4,
               info->channels > 1 ? names[c] : "projector", c);
  }
  draw_curve(page, &info->camera, "#a855f7", 2.4, "camera", info->channels);
  draw_curve(page, &srgb, "var(--soft)", 1.2, "sRGB", info->channels + 1);
  draw_curve(page, &linear, "var(--soft)", 1.0, "linear", info->channels + 2);
  fputs("</svg>\n", page);
}

/* The bins from the first to the last that hold anything, and one to either side. */
static void reach(const clt_latency *latency, int *first, int *last, int *most) {
  *first = CLT_LATENCY_BINS;
  *last = *most = 0;
  for (int k = 0; k < CLT_LATENCY_BINS; k++) {
    if (latency->histogram[k] > 0) {
      *first = k < *first ? k : *first;
      *last = k;
      *most = latency->histogram[k] > *most ? latency->histogram[k] : *most;
    }
  }
  *first = *first > 0 ? *first - 1 : 0;
  *last = *last + 1 < CLT_LATENCY_BINS ? *last + 1 : *last;
}

void cli_draw_latency(FILE *page, const clt_latency *latency) {
  int first, last, most;
  reach(latency, &first, &last, &most);
  if (most == 0 || first > last) {
    fputs("<p class=\"soft\">No single change could be timed.</p>\n", page);
    return;
  }
  double bins = last - first + 1, step = WIDTH / bins;
  begin(page, "from a refresh until its light, ms", "changes");
  for (int k = 0; k <= 2; k++) {
    grid_line(page, k / 2.0, "%.3g", k * most / 2.0);
  }
  for (int k = first; k <= last; k++) {
    double top = at_y((double)latency->histogram[k] / most);
    fprintf(page, "<rect style=\"fill:#3b82f6\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>",
            LEFT + step * (k - first) + 1, top, fmax(step - 2, 1), TOP + HEIGHT - top);
  }
  fputc('\n', page);
  double low = latency->bin_first_s + first * latency->bin_s, width = bins * latency->bin_s;
  for (int k = 0; k <= 4; k++) {
    tick(page, k / 4.0, "%.1f", 1e3 * (low + k / 4.0 * width));
  }
  double mark = LEFT + WIDTH * (latency->seconds - low) / width;
  fprintf(page, "<line style=\"stroke:var(--mark);stroke-width:2\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.0f\" y2=\"%.0f\"/>",
          mark, mark, TOP, TOP + HEIGHT);
  fputs("<text x=\"640\" y=\"32\" style=\"fill:var(--mark)\">estimate</text>\n</svg>\n", page);
}
