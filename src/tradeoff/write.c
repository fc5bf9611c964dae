/* tradeoff.csv, .svg and .html. */
#include <math.h>
#include <stdlib.h>

#include "base/file.h"
#include "base/memory.h"
#include "base/page.h"
#include "tradeoff/front.h"
#include "tradeoff/plot.h"

static void put_table(const clt_tradeoff *tradeoff, FILE *to) {
  fputs("number,method,storage,tolerance,iterations,time_ms,repeats,prepare_ms,error,solver_error,storage_error,"
        "clipping_error,noise_error,expected_error,front,chosen\n",
        to);
  for (size_t k = 0; k < tradeoff->count; k++) {
    const clt_tradeoff_point *point = &tradeoff->points[k];
    fprintf(to, "%zu,%s,%s,%g,%d,%.17g,%d,%.6g,%.17g,%.9g,%.9g,%.9g,", k, point->method, point->storage,
            point->tolerance, point->iterations, 1e3 * point->seconds, point->repeats, 1e3 * point->prepare_seconds,
            point->error, point->solver_error, point->storage_error, point->clipping_error);
    if (point->noise_error >= 0) {
      fprintf(to, "%.9g", point->noise_error);
    }
    fprintf(to, ",%.9g,%d,%d\n", clt_tradeoff_expected(point), point->front, k == tradeoff->chosen);
  }
}

static void put_words(const clt_tradeoff *tradeoff, FILE *page) {
  const clt_tradeoff_point *chosen = &tradeoff->points[tradeoff->chosen];
  char time[24], error[24], ready[24];
  clt_front_time(chosen->seconds, time);
  clt_front_time(chosen->prepare_seconds, ready);
  clt_front_share(chosen->error, error);
  fputs("<h1>What accuracy costs</h1>\n<p class=\"lead\">", page);
  clt_page_text(page, tradeoff->sentence);
  fputs(".</p>\n", page);
  fprintf(page,
          "<p class=\"soft\">%d&nbsp;&times;&nbsp;%d cells, %d channel%s; %zu solves, measured on this machine in one "
          "run. Chosen: <b>%s</b> with T stored as %s, %d iteration%s: %s off in %s",
          tradeoff->width, tradeoff->height, tradeoff->channels, tradeoff->channels == 1 ? "" : "s", tradeoff->count,
          chosen->method, chosen->storage, chosen->iterations, chosen->iterations == 1 ? "" : "s", error, time);
  if (chosen->prepare_seconds > 0) {
    fprintf(page, " (made ready once in %s)", ready);
  }
  fprintf(page, "; %s.</p>\n", tradeoff->chosen_why);
}

static void put_share(FILE *page, double share) {
  char text[24];
  clt_front_share(share, text);
  fprintf(page, "<td class=\"n\">%s", share >= 0 ? text : "");
}

static void put_time(FILE *page, double seconds) {
  char text[24];
  clt_front_time(seconds, text);
  fprintf(page, "<td class=\"n\">%s", seconds > 0 ? text : "");
}

static clt_status put_front(const clt_tradeoff *tradeoff, FILE *page, clt_error *error) {
  size_t *order = clt_alloc(tradeoff->count + 1, sizeof *order);
  if (order == NULL) {
    return clt_fail(error, CLT_FAILED, "not enough memory for a table of %zu points", tradeoff->count);
  }
  size_t count = clt_front_list(tradeoff, order);
  fputs("<h2>The front, and where its errors come from</h2>\n<div class=\"wide\"><table><tr "
        "class=\"soft\"><td>method<td>T stored as"
        "<td class=\"n\">iterations<td class=\"n\">made ready in<td class=\"n\">time<td class=\"n\">off by<td "
        "class=\"n\">solver<td class=\"n\">storage<td class=\"n\">0..1<td class=\"n\">camera noise</tr>\n",
        page);
  for (size_t k = 0; k < count; k++) {
    const clt_tradeoff_point *point = &tradeoff->points[order[k]];
    const char *open = order[k] == tradeoff->chosen ? "<b>" : "", *close = *open ? "</b>" : "";
    fprintf(page, "<tr><td>%s%s%s<td>%s<td class=\"n\">%d", open, point->method, close, point->storage,
            point->iterations);
    put_time(page, point->prepare_seconds);
    put_time(page, point->seconds);
    put_share(page, point->error);
    put_share(page, point->solver_error);
    put_share(page, point->storage_error);
    put_share(page, point->clipping_error);
    put_share(page, point->noise_error);
    fputs("</tr>\n", page);
  }
  fputs("</table></div>\n", page);
  free(order);
  return CLT_OK;
}

static const char meaning[] =
    "<h2>What the words mean</h2>\n<dl>\n"
    "<dt>Off by</dt><dd>The root mean square of the difference between what the transport says will be seen and what "
    "was "
    "wanted, over every lit cell and colour, divided by that of the wanted picture, in linear light.</dd>\n"
    "<dt>Solver</dt><dd>What the method left when it stopped, by its own account: with T as it was stored. Of methods "
    "that keep the drive within 0..1: how far it is from the best such drive.</dd>\n"
    "<dt>Storage</dt><dd>What storing T in fewer bits changes in this drive's picture.</dd>\n"
    "<dt>0..1</dt><dd>What it costs that a projector gives no less than nothing and no more than all.</dd>\n"
    "<dt>Camera noise</dt><dd>What the noise in T itself lets the real room differ from what T says; it adds to the "
    "error as squares do. Nothing stands here where the transport file has no deviations.</dd>\n"
    "<dt>How they add</dt><dd>Solver, storage and 0..1 are lengths of three pictures that add up to the error cell by "
    "cell. They may cancel: their sum is never less than the error.</dd>\n"
    "<dt>Time</dt><dd>Median of up to five solves from scratch, every colour; making the method ready is counted "
    "apart, "
    "for it is done once for all pictures.</dd>\n</dl>\n";

static void put_gaps(const clt_tradeoff *tradeoff, FILE *page) {
  if (tradeoff->gap_count == 0) {
    return;
  }
  fputs("<h2>What is not in the drawing, and why</h2>\n<div class=\"wide\"><table>\n", page);
  for (size_t k = 0; k < tradeoff->gap_count; k++) {
    fprintf(page, "<tr><td>%s<td>%s<td class=\"soft\">", tradeoff->gaps[k].method, tradeoff->gaps[k].storage);
    clt_page_text(page, tradeoff->gaps[k].why);
    fputs("</tr>\n", page);
  }
  fputs("</table></div>\n", page);
}

static clt_status put_page(const clt_tradeoff *tradeoff, FILE *page, clt_error *error) {
  clt_page_begin(page, "counterlight: what accuracy costs");
  put_words(tradeoff, page);
  fputs("<figure style=\"padding:14px\">", page);
  clt_status status = clt_plot_write(tradeoff, page, error);
  fputs("</figure>\n", page);
  if (status == CLT_OK) {
    status = put_front(tradeoff, page, error);
  }
  fputs(meaning, page);
  put_gaps(tradeoff, page);
  fputs("<p class=\"soft\">Every solve: <code>tradeoff.csv</code>.</p>\n", page);
  clt_page_end(page);
  return status;
}

typedef clt_status put_file(const clt_tradeoff *tradeoff, FILE *to, clt_error *error);

static clt_status put_csv(const clt_tradeoff *tradeoff, FILE *to, clt_error *error) {
  (void)error;
  put_table(tradeoff, to);
  return CLT_OK;
}

static clt_status put_svg(const clt_tradeoff *tradeoff, FILE *to, clt_error *error) {
  return clt_plot_write(tradeoff, to, error);
}

clt_status clt_tradeoff_write(const clt_tradeoff *tradeoff, const char *folder, clt_error *error) {
  const struct {
    const char *name;
    put_file *put;
  } files[] = {{"tradeoff.csv", put_csv}, {"tradeoff.svg", put_svg}, {"tradeoff.html", put_page}};
  clt_status status = CLT_OK;
  for (size_t k = 0; k < sizeof files / sizeof files[0] && status == CLT_OK; k++) {
    char path[CLT_PATH_MAX];
    clt_text text = {0};
    status = clt_file_join(folder, files[k].name, path, error);
    if (status == CLT_OK) {
      status = clt_text_open(&text, path, error);
    }
    if (status == CLT_OK) {
      status = files[k].put(tradeoff, text.to, error);
    }
    status = clt_text_close(&text, status, error);
  }
  return status;
}
