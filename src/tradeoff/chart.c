#include "tradeoff/chart.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.h"

clt_chart_line *clt_chart_add(clt_chart *chart, const char *format, ...) {
  clt_chart_line *line = &chart->lines[chart->count++];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(line->label, sizeof line->label, format, arguments);
  va_end(arguments);
  line->count = 0;
  line->colour = chart->count - 1;
  line->dashed = false;
  return line;
}

void clt_chart_point(clt_chart_line *line, double x, double y) {
  if (line->count < CLT_CHART_POINTS_MAX) {
    line->x[line->count] = x;
    line->y[line->count++] = y;
  }
}

bool clt_chart_can_draw(void) {
  static const char *const places[] = {"/usr/bin/gnuplot", "/usr/local/bin/gnuplot", "/bin/gnuplot"};
  for (size_t k = 0; k < sizeof places / sizeof places[0]; k++) {
    if (access(places[k], X_OK) == 0) {
      return true;
    }
  }
  return false;
}

static void print_table(const clt_chart *chart, FILE *to) {
  fprintf(to, "line,x,y\n");
  for (int k = 0; k < chart->count; k++) {
    for (int i = 0; i < chart->lines[k].count; i++) {
      fprintf(to, "\"%s\",%.9g,%.9g\n", chart->lines[k].label, chart->lines[k].x[i], chart->lines[k].y[i]);
    }
  }
}

static void print_points(const clt_chart *chart, const clt_chart_line *line, FILE *to) {
  for (int i = 0; i < line->count; i++) {
    bool drawn = isfinite(line->y[i]) && (!chart->log_up || line->y[i] > 0) && (!chart->log_across || line->x[i] > 0);
    if (drawn) {
      fprintf(to, "%.9g %.9g\n", line->x[i], line->y[i]);
    }
  }
}

/* Colours that can be told apart by most eyes (Okabe and Ito). */
static const char *const colours[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                      "#e69f00", "#56b4e9", "#000000", "#888888"};

static void print_script(const clt_chart *chart, const char *drawing, FILE *to) {
  fprintf(to, "set terminal svg size 720,440 font \"sans-serif,13\" background rgb \"white\"\nset output \"%s\"\n",
          drawing);
  fprintf(to, "set title \"%s\" noenhanced\nset xlabel \"%s\" noenhanced\nset ylabel \"%s\" noenhanced\n", chart->title,
          chart->across, chart->up);
  fprintf(to, "set grid lc rgb \"#dddddd\"\nset key outside right noenhanced\nset border 3\nset tics nomirror\n");
  fprintf(to, "%s%s", chart->log_across ? "set logscale x\n" : "", chart->log_up ? "set logscale y\n" : "");
  fprintf(to, "%s", chart->log_up ? "set format y \"10^{%T}\"\n" : "");
  for (int k = 0; k < chart->count; k++) {
    fprintf(to, "$line%d << END\n", k);
    print_points(chart, &chart->lines[k], to);
    fprintf(to, "END\n");
  }
  for (int k = 0; k < chart->count; k++) {
    const clt_chart_line *line = &chart->lines[k];
    fprintf(to, "%s$line%d using 1:2 with linespoints pt 7 ps 0.5 lw 1.5 dt %d lc rgb \"%s\" title \"%s\"",
            k == 0 ? "plot " : ", ", k, line->dashed ? 2 : 1,
            colours[(size_t)line->colour % (sizeof colours / sizeof colours[0])], line->label);
  }
  fprintf(to, "\n");
}

/* Runs gnuplot on a script; its complaints go to the end of the error. */
static clt_status run_gnuplot(char *script, size_t size, clt_error *error) {
  int input[2], output[2];
  if (pipe(input) != 0 || pipe(output) != 0) {
    return clt_fail(error, CLT_FAILED, "no pipe for gnuplot: %s", strerror(errno));
  }
  pid_t child = fork();
  if (child == 0) {
    dup2(input[0], 0);
    dup2(output[1], 1);
    dup2(output[1], 2);
    close(input[0]), close(input[1]), close(output[0]), close(output[1]);
    execlp("gnuplot", "gnuplot", (char *)NULL);
    _exit(127);
  }
  close(input[0]);
  close(output[1]);
  FILE *to = fdopen(input[1], "w");
  if (to != NULL) {
    fwrite(script, 1, size, to);
    fclose(to);
  }
  char said[256] = "";
  ssize_t got = read(output[0], said, sizeof said - 1);
  said[got > 0 ? got : 0] = '\0';
  said[strcspn(said, "\n")] = '\0';
  close(output[0]);
  int code = 0;
  bool ended = child > 0 && waitpid(child, &code, 0) == child;
  return ended && code == 0 ? CLT_OK
                            : clt_fail(error, CLT_FAILED, "gnuplot could not draw a chart: %s",
                                       said[0] != '\0' ? said : "it did not run; install gnuplot-nox");
}

static clt_status draw(const clt_chart *chart, const char *path, clt_error *error) {
  char temporary[CLT_PATH_MAX], *script = NULL;
  size_t size = 0;
  FILE *to = open_memstream(&script, &size);
  if (to == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for the script of a chart");
  }
  clt_status status = clt_file_begin(path, temporary, error);
  print_script(chart, temporary, to);
  fclose(to);
  if (status == CLT_OK) {
    status = run_gnuplot(script, size, error);
    status = status == CLT_OK ? clt_file_commit(temporary, path, error) : (clt_file_abandon(temporary), status);
  }
  free(script);
  return status;
}

clt_status clt_chart_write(const clt_chart *chart, const char *folder, const char *name, clt_error *error) {
  char file[128], path[CLT_PATH_MAX];
  clt_text table = {0};
  snprintf(file, sizeof file, "%s.csv", name);
  clt_status status = clt_file_join(folder, file, path, error);
  if (status == CLT_OK) {
    status = clt_text_open(&table, path, error);
  }
  if (status == CLT_OK) {
    print_table(chart, table.to);
  }
  status = clt_text_close(&table, status, error);
  if (status != CLT_OK || !clt_chart_can_draw()) {
    return status;
  }
  snprintf(file, sizeof file, "%s.svg", name);
  status = clt_file_join(folder, file, path, error);
  return status == CLT_OK ? draw(chart, path, error) : status;
}
