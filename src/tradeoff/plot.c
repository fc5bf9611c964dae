#include "tradeoff/plot.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "tradeoff/front.h"

static const double LEAST_ERROR = 1e-6, LEAST_TIME = 1e-7; /* what is drawn for less: logarithms need more than 0 */
static const double MARGIN = 0.12;                         /* of a decade, around the points */
enum { LABELS_MOST = 24, WIDTH = 1000, HEIGHT = 600, GLYPH = 7 /* px of a letter of a label */ };

/* Methods of a family share a colour. */
static const struct family {
  const char *name, *methods;
} families[] = {
    {"kept within 0..1", " auto bounded "},
    {"Krylov", " pcg deflated-pcg gmres lsmr "},
    {"fixed point", " series jacobi damped chebyshev "},
    {"relaxation", " gauss-seidel sor southwell "},
    {"entries of T kept", " direct stored-inverse matrix clusters wavelet "},
    {"Monte Carlo", " montecarlo hybrid "},
};
enum { FAMILIES = sizeof families / sizeof families[0] };

/* A storage is a shape: a path around the origin. */
static const struct shape {
  const char *storage, *path;
} shapes[] = {{"dense64", "M-4-4H4V4H-4z"},
              {"dense", "M-4.6 0a4.6 4.6 0 1 0 9.2 0a4.6 4.6 0 1 0-9.2 0z"},
              {"dense16", "M0-5.4L5 3.8H-5z"},
              {"dense8", "M0-5.8L5.8 0L0 5.8L-5.8 0z"},
              {"tree", "M-5.6-1.7H-1.7V-5.6H1.7V-1.7H5.6V1.7H1.7V5.6H-1.7V1.7H-5.6z"}};
enum { SHAPES = sizeof shapes / sizeof shapes[0] };

/* Colours by name, without variables: not every viewer knows those. */
static const char style[] =
    "<style>.tradeoff{font:13px system-ui,\"Segoe UI\",\"DejaVu Sans\",sans-serif;background:#fff}"
    ".tradeoff text{fill:#5d616b;font-size:13px}.tradeoff .ink{fill:#22242a}.tradeoff "
    ".name{font-weight:600;fill:#22242a}"
    ".tradeoff .small{font-size:11.5px}.tradeoff path.grid{stroke:#e2dfd8;fill:none}"
    ".tradeoff path.axis{stroke:#5d616b;fill:none}.tradeoff path.level{stroke:#5d616b;stroke-dasharray:2 4;fill:none}"
    ".tradeoff path.front{stroke:#c2410c;stroke-width:2;fill:none;stroke-linejoin:round}"
    ".tradeoff path.lead{stroke:#5d616b;stroke-width:.8;fill:none}"
    ".tradeoff .chosen{stroke:#c2410c;stroke-width:3;fill:none}"
    ".tradeoff .halo{stroke:#fff;stroke-width:4;paint-order:stroke;stroke-linejoin:round}"
    ".tradeoff .p0{fill:#c2410c}.tradeoff .p1{fill:#0072b2}.tradeoff .p2{fill:#0f8f6f}.tradeoff .p3{fill:#8e4fc4}"
    ".tradeoff .p4{fill:#a97a00}.tradeoff .p5{fill:#c2417f}.tradeoff .other{opacity:.45}\n"
    "@media (prefers-color-scheme:dark){.tradeoff{background:#1c1e25}.tradeoff text{fill:#a3a6b0}"
    ".tradeoff .ink,.tradeoff .name{fill:#e8e6e1}.tradeoff path.grid{stroke:#2e313b}"
    ".tradeoff path.axis,.tradeoff path.level,.tradeoff path.lead{stroke:#a3a6b0}"
    ".tradeoff path.front,.tradeoff .chosen{stroke:#fb923c}.tradeoff .halo{stroke:#1c1e25}"
    ".tradeoff .p0{fill:#fb923c}.tradeoff .p1{fill:#56b4e9}.tradeoff .p2{fill:#3ecfa6}.tradeoff .p3{fill:#c39af0}"
    ".tradeoff .p4{fill:#e3b53d}.tradeoff .p5{fill:#f28ab8}}</style>\n";

typedef struct box {
  double left, top, right, bottom;
} box;

typedef struct plot {
  const clt_tradeoff *of;
  FILE *to;
  box area;
  double x_low, x_high, y_low, y_high; /* decades: of seconds, of error */
  box taken[LABELS_MOST];              /* by labels */
  int labels;
} plot;

static size_t family_of(const char *method) {
  char word[32];
  size_t k = 0;
  snprintf(word, sizeof word, " %s ", method);
  while (k + 1 < FAMILIES && strstr(families[k].methods, word) == NULL) {
    k++;
  }
  return k;
}

static size_t shape_of(const char *storage) {
  size_t k = 0;
  while (k + 1 < SHAPES && strcmp(shapes[k].storage, storage) != 0) {
    k++;
  }
  return k;
}

static double decade_of_time(double seconds) {
  return log10(fmax(seconds, LEAST_TIME));
}
static double decade_of_error(double error) {
  return log10(fmax(error, LEAST_ERROR));
}
static double at_x(const plot *p, double decade) {
  return p->area.left + (p->area.right - p->area.left) * (decade - p->x_low) / (p->x_high - p->x_low);
}
static double at_y(const plot *p, double decade) {
  return p->area.bottom - (p->area.bottom - p->area.top) * (decade - p->y_low) / (p->y_high - p->y_low);
}
static double point_x(const plot *p, const clt_tradeoff_point *point) {
  return at_x(p, decade_of_time(point->seconds));
}
static double point_y(const plot *p, const clt_tradeoff_point *point) {
  return at_y(p, decade_of_error(point->error));
}

static void choose_axes(plot *p) {
  p->x_low = p->y_low = INFINITY;
  p->x_high = p->y_high = -INFINITY;
  for (size_t k = 0; k < p->of->count; k++) {
    const clt_tradeoff_point *point = &p->of->points[k];
    p->x_low = fmin(p->x_low, decade_of_time(point->seconds));
    p->x_high = fmax(p->x_high, decade_of_time(point->seconds));
    p->y_low = fmin(p->y_low, decade_of_error(point->error));
    p->y_high = fmax(p->y_high, decade_of_error(fmin(point->error, 10)));
  }
  double most = fmax(p->x_high - p->x_low, 0.5), rise = fmax(p->y_high - p->y_low, 0.5);
  p->x_low -= MARGIN * fmax(most / 3, 1);
  p->x_high = p->x_low + most + 2 * MARGIN * fmax(most / 3, 1);
  p->y_low -= MARGIN * fmax(rise / 2, 1);
  p->y_high = p->y_low + rise + 2 * MARGIN * fmax(rise / 2, 1);
}

/* Ticks at 1, or 1 2 5, times powers of ten: as many as there is room for. */
static bool is_tick(int k, double span) {
  return span > 2.2 ? k == 0 : true;
}

static void draw_times(plot *p) {
  static const double steps[] = {1, 2, 5};
  for (int decade = (int)floor(p->x_low); decade <= (int)ceil(p->x_high); decade++) {
    for (int k = 0; k < 3; k++) {
      double value = decade + log10(steps[k]), x = at_x(p, value);
      char text[24];
      if (value < p->x_low || value > p->x_high) {
        continue;
      }
      fprintf(p->to, "<path class=\"grid\" d=\"M%.1f %.1fV%.1f\" opacity=\"%s\"/>", x, p->area.top, p->area.bottom,
              k == 0 ? "1" : ".55");
      clt_front_time(pow(10, value), text);
      if (is_tick(k, p->x_high - p->x_low)) {
        fprintf(p->to, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n", x, p->area.bottom + 20, text);
      }
    }
  }
  fprintf(p->to, "<text class=\"ink\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">time of a solve</text>\n",
          (p->area.left + p->area.right) / 2, p->area.bottom + 46);
}

static void draw_errors(plot *p) {
  static const double steps[] = {1, 2, 5};
  double middle = (p->area.top + p->area.bottom) / 2;
  for (int decade = (int)floor(p->y_low); decade <= (int)ceil(p->y_high); decade++) {
    for (int k = 0; k < 3; k++) {
      double value = decade + log10(steps[k]), y = at_y(p, value);
      if (value < p->y_low || value > p->y_high) {
        continue;
      }
      fprintf(p->to, "<path class=\"grid\" d=\"M%.1f %.1fH%.1f\" opacity=\"%s\"/>", p->area.left, y, p->area.right,
              k == 0 ? "1" : ".55");
      if (is_tick(k, p->y_high - p->y_low)) {
        fprintf(p->to, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%.3g %%</text>\n", p->area.left - 9, y + 4.5,
                100 * pow(10, value));
      }
    }
  }
  fprintf(p->to,
          "<text class=\"ink\" transform=\"translate(18 %.1f) rotate(-90)\" text-anchor=\"middle\">error of what is "
          "seen, relative RMS</text>\n",
          middle);
}

/* A level that limits every point, where it lies within the drawing. */
static void draw_level(plot *p, double error, const char *what) {
  char share[24];
  double decade = decade_of_error(error), y = at_y(p, decade);
  if (!(error > 0) || decade < p->y_low || decade > p->y_high || p->labels == LABELS_MOST) {
    return;
  }
  clt_front_share(error, share);
  fprintf(p->to, "<path class=\"level\" d=\"M%.1f %.1fH%.1f\"/>", p->area.left, y, p->area.right);
  bool below = y + 20 < p->area.bottom;
  double baseline = below ? y + 15 : y - 6;
  fprintf(p->to, "<text class=\"halo small\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s: %s</text>\n",
          p->area.right - 6, baseline, what, share);
  double wide = 0.95 * GLYPH * (double)(strlen(what) + strlen(share) + 2);
  p->taken[p->labels++] = (box){p->area.right - 6 - wide, baseline - 12, p->area.right, baseline + 4};
}

static void draw_point(plot *p, const clt_tradeoff_point *point) {
  char share[24], time[24];
  clt_front_share(point->error, share);
  clt_front_time(point->seconds, time);
  if (point->error > 10) {
    return; /* a drive that makes it ten times worse than nothing */
  }
  fprintf(p->to, "<path class=\"p%zu%s\" transform=\"translate(%.1f %.1f)\" d=\"%s\">", family_of(point->method),
          point->front ? "" : " other", point_x(p, point), point_y(p, point), shapes[shape_of(point->storage)].path);
  fprintf(p->to, "<title>%s, %s, stopped at %.0e, %d iteration%s: %s off in %s</title></path>\n", point->method,
          point->storage, point->tolerance, point->iterations, point->iterations == 1 ? "" : "s", share, time);
}

static void draw_front(plot *p, const size_t *order, size_t count) {
  fputs("<path class=\"front\" d=\"", p->to);
  for (size_t k = 0; k < count; k++) {
    const clt_tradeoff_point *point = &p->of->points[order[k]];
    if (k == 0) {
      fprintf(p->to, "M%.1f %.1f", point_x(p, point), fmax(point_y(p, point), p->area.top));
    } else {
      fprintf(p->to, "H%.1fV%.1f", point_x(p, point), point_y(p, point));
    }
  }
  fprintf(p->to, "H%.1f\"/>\n", p->area.right);
}

static bool overlaps(const box *a, const box *b) {
  return a->left < b->right && b->left < a->right && a->top < b->bottom && b->top < a->bottom;
}

/* True where the box lies inside the drawing, off the other labels and off the front's points. */
static bool is_free(const plot *p, const box *wanted, const size_t *order, size_t count) {
  if (wanted->left < p->area.left || wanted->right > p->area.right || wanted->top < p->area.top ||
      wanted->bottom > p->area.bottom) {
    return false;
  }
  for (int k = 0; k < p->labels; k++) {
    if (overlaps(wanted, &p->taken[k])) {
      return false;
    }
  }
  for (size_t k = 0; k < count; k++) {
    double x = point_x(p, &p->of->points[order[k]]), y = point_y(p, &p->of->points[order[k]]);
    box dot = {x - 6, y - 6, x + 6, y + 6};
    if (overlaps(wanted, &dot)) {
      return false;
    }
  }
  return true;
}

/* Puts the label of a point of the front where there is room around it; none, none. */
static void draw_label(plot *p, const size_t *order, size_t count, size_t k) {
  static const struct offset {
    double x, y;
  } offsets[] = {{-12, 20}, {-12, 34}, {12, -10}, {12, -26}, {-12, 50}, {16, -42},
                 {16, -58}, {-12, 70}, {20, -76}, {-30, 90}, {20, -96}, {-60, 40}};
  const clt_tradeoff_point *point = &p->of->points[order[k]];
  bool chosen = order[k] == p->of->chosen;
  char text[96];
  snprintf(text, sizeof text, "%s, %s, %d iteration%s", point->method, point->storage, point->iterations,
           point->iterations == 1 ? "" : "s");
  double wide = GLYPH * (double)strlen(text) * (chosen ? 1.06 : 1);
  for (size_t i = 0; i < sizeof offsets / sizeof offsets[0] && p->labels < LABELS_MOST; i++) {
    double x = point_x(p, point) + offsets[i].x, y = point_y(p, point) + offsets[i].y;
    bool left = offsets[i].x < 0;
    box wanted = {left ? x - wide : x, y - 12, left ? x : x + wide, y + 4};
    if (is_free(p, &wanted, order, count)) {
      p->taken[p->labels++] = wanted;
      fprintf(p->to, "<path class=\"lead\" d=\"M%.1f %.1fL%.1f %.1f\"/>", point_x(p, point), point_y(p, point),
              left ? x + 2 : x - 2, y - 4);
      fprintf(p->to, "<text class=\"halo %s\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s</text>\n",
              chosen ? "name" : "ink", x, y, left ? "end" : "start", text);
      return;
    }
  }
}

static void draw_chosen(plot *p) {
  const clt_tradeoff_point *point = &p->of->points[p->of->chosen];
  fprintf(p->to, "<circle class=\"chosen\" cx=\"%.1f\" cy=\"%.1f\" r=\"11\"/>\n", point_x(p, point), point_y(p, point));
}

static void draw_key(plot *p) {
  bool family[FAMILIES] = {false}, shape[SHAPES] = {false};
  double x = p->area.right + 30, y = p->area.top + 10;
  for (size_t k = 0; k < p->of->count; k++) {
    family[family_of(p->of->points[k].method)] = true;
    shape[shape_of(p->of->points[k].storage)] = true;
  }
  fprintf(p->to, "<text class=\"name\" x=\"%.1f\" y=\"%.1f\">methods</text>\n", x - 8, y);
  for (size_t k = 0; k < FAMILIES; k++) {
    if (family[k]) {
      y += 22;
      fprintf(p->to, "<circle class=\"p%zu\" cx=\"%.1f\" cy=\"%.1f\" r=\"5\"/><text x=\"%.1f\" y=\"%.1f\">%s</text>\n",
              k, x, y - 4, x + 14, y, families[k].name);
    }
  }
  fprintf(p->to, "<text class=\"name\" x=\"%.1f\" y=\"%.1f\">T is stored as</text>\n", x - 8, y += 38);
  for (size_t k = 0; k < SHAPES; k++) {
    if (shape[k]) {
      y += 22;
      fprintf(p->to,
              "<path class=\"ink\" transform=\"translate(%.1f %.1f)\" d=\"%s\"/><text x=\"%.1f\" y=\"%.1f\">%s</text>"
              "\n",
              x, y - 4, shapes[k].path, x + 14, y, shapes[k].storage);
    }
  }
  y += 38;
  fprintf(p->to, "<path class=\"front\" d=\"M%.1f %.1fh22\"/><text x=\"%.1f\" y=\"%.1f\">the front: no other is</text>",
          x - 8, y - 4, x + 20, y);
  fprintf(p->to, "<text x=\"%.1f\" y=\"%.1f\">both faster and nearer</text>\n", x + 20, y + 17);
  fprintf(p->to,
          "<circle class=\"chosen\" cx=\"%.1f\" cy=\"%.1f\" r=\"8\"/><text x=\"%.1f\" y=\"%.1f\">chosen</text>\n",
          x + 3, y + 38, x + 20, y + 43);
}

clt_status clt_plot_write(const clt_tradeoff *tradeoff, FILE *to, clt_error *error) {
  size_t *order = clt_alloc(tradeoff->count + 1, sizeof *order);
  plot p = {.of = tradeoff, .to = to, .area = {92, 22, 766, 528}};
  if (order == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory to draw %zu points", tradeoff->count);
  }
  size_t count = clt_front_list(tradeoff, order);
  choose_axes(&p);
  fprintf(to,
          "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"tradeoff\" viewBox=\"0 0 %d %d\" role=\"img\" "
          "aria-label=\"error against time\">\n%s",
          WIDTH, HEIGHT, style);
  draw_times(&p);
  draw_errors(&p);
  fprintf(to, "<path class=\"axis\" d=\"M%.1f %.1fV%.1fH%.1f\"/>\n", p.area.left, p.area.top, p.area.bottom,
          p.area.right);
  draw_level(&p, tradeoff->limit, "no drive in 0..1 comes nearer");
  draw_level(&p, tradeoff->noise, "the camera's noise");
  for (size_t k = 0; k < tradeoff->count; k++) {
    draw_point(&p, &tradeoff->points[k]);
  }
  draw_front(&p, order, count);
  for (size_t k = 0; k < count; k++) {
    draw_point(&p, &tradeoff->points[order[k]]);
  }
  draw_chosen(&p);
  for (size_t k = 0; k < count; k++) {
    if (order[k] == tradeoff->chosen) {
      draw_label(&p, order, count, k);
    }
  }
  for (size_t k = 0; k < count; k++) {
    if (order[k] != tradeoff->chosen) {
      draw_label(&p, order, count, k);
    }
  }
  draw_key(&p);
  fputs("</svg>\n", to);
  free(order);
  return CLT_OK;
}
