/* Charts of reports: a table for programs, and a drawing by gnuplot where it is installed. */
#ifndef CLT_TRADEOFF_CHART_H
#define CLT_TRADEOFF_CHART_H

#include <stdbool.h>

#include "counterlight/status.h"

enum { CLT_CHART_LINES_MAX = 12, CLT_CHART_POINTS_MAX = 64, CLT_CHART_LABEL_MAX = 48 };

typedef struct clt_chart_line {
  char label[CLT_CHART_LABEL_MAX];
  int colour;  /* the number of the line that it shares one with; its own at first */
  bool dashed; /* a bound or another's figures, beside solid lines of what was found */
  int count;
  double x[CLT_CHART_POINTS_MAX], y[CLT_CHART_POINTS_MAX];
} clt_chart_line;

/* Lines over common axes. */
typedef struct clt_chart {
  const char *title, *across, *up; /* plain text without quotes */
  bool log_across, log_up;
  int count;
  clt_chart_line lines[CLT_CHART_LINES_MAX];
} clt_chart;

/* A new line of the chart, at most CLT_CHART_LINES_MAX of them. */
clt_chart_line *clt_chart_add(clt_chart *chart, const char *format, ...) CLT_PRINTF(2, 3);
/* Points beyond CLT_CHART_POINTS_MAX are left out. */
void clt_chart_point(clt_chart_line *line, double x, double y);

/* Writes FOLDER/NAME.csv (line, x, y) and, by gnuplot, FOLDER/NAME.svg. Where gnuplot is not installed there is no
 * drawing; one that fails is CLT_FAILED with what it said. */
clt_status clt_chart_write(const clt_chart *chart, const char *folder, const char *name, clt_error *error);
/* True where gnuplot can be run. */
bool clt_chart_can_draw(void);

#endif
