#include "tradeoff/reproduce/page.h"

#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/page.h"

static void put_opening(FILE *page, const clt_reproduction *rows) {
  int passed = 0;
  for (int k = 0; k < rows->count; k++) {
    passed += rows->rows[k].pass;
  }
  fputs("<h1>The report, computed again</h1>\n", page);
  fprintf(page, "<p class=\"lead\"><b>%d of %d</b> claims of the report came out as it says, or better.</p>\n", passed,
          rows->count);
  fputs("<p class=\"soft\">Bai, Chandraker, Ng, Ramamoorthi, A Dual Theory of Inverse and Forward Light Transport "
        "(UCB/EECS-2010-101): its tables and figures that rest on simulation, and Figs. 12 and 13 on simulated rooms. "
        "Times are of this machine; the report's are of Matlab on a processor of 2010.</p>\n",
        page);
}

static void put_rows(FILE *page, const clt_page_part *part, const clt_reproduction *rows) {
  static const struct {
    const char *name;
    int width;
  } columns[] = {{"claim", 16}, {"the report", 33}, {"here", 42}, {"verdict", 9}};
  fputs("<table><tr>", page);
  for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) {
    fprintf(page, "<td class=\"soft\" style=\"width:%d%%\">%s", columns[i].width, columns[i].name);
  }
  fputs("</tr>\n", page);
  for (int k = part->first; k < part->last; k++) {
    const clt_reproduced *row = &rows->rows[k];
    const char *cells[] = {row->name, row->report, row->ours};
    fputs("<tr>", page);
    for (size_t i = 0; i < sizeof cells / sizeof cells[0]; i++) {
      fputs("<td>", page);
      clt_page_text(page, cells[i]);
    }
    fputs(row->pass ? "<td class=\"n\">as said</tr>\n" : "<td class=\"n lead\"><b>differs</b></tr>\n", page);
  }
  fputs("</table>\n", page);
}

static clt_status put_picture(FILE *page, const char *path, const clt_figure_file *file, clt_error *error) {
  bool drawn = strcmp(strrchr(file->name, '.'), ".svg") == 0;
  fprintf(page, "<figure%s><img alt=\"", file->wide ? " style=\"grid-column:1/-1\"" : "");
  clt_page_text(page, file->caption);
  fputs("\" src=\"", page);
  clt_status status = clt_page_embed(page, path, drawn ? "svg+xml" : "png", error);
  fputs("\"><figcaption>", page);
  clt_page_text(page, file->caption);
  fputs(" <span>", page);
  clt_page_text(page, file->name);
  fputs(drawn ? "; its numbers: .csv</span>" : "</span>", page);
  fputs("</figcaption></figure>\n", page);
  return status;
}

/* The files of a part that are there: without gnuplot there are no charts. */
static clt_status put_pictures(FILE *page, const char *folder, const clt_figure *figure, clt_error *error) {
  clt_status status = CLT_OK;
  fputs("<div class=\"pair\">\n", page);
  for (int k = 0; k < CLT_FIGURE_FILES && figure->files[k].name != NULL && status == CLT_OK; k++) {
    char path[CLT_PATH_MAX];
    status = clt_file_join(folder, figure->files[k].name, path, error);
    if (status == CLT_OK && access(path, R_OK) == 0) {
      status = put_picture(page, path, &figure->files[k], error);
    }
  }
  fputs("</div>\n", page);
  return status;
}

static clt_status put_parts(FILE *page, const char *folder, const clt_page_part *parts, int count,
                            const clt_reproduction *rows, clt_error *error) {
  clt_status status = CLT_OK;
  for (int k = 0; k < count && status == CLT_OK; k++) {
    fprintf(page, "<h2>%s</h2>\n<p class=\"soft\">", parts[k].figure->name); /* its own words, without < or & */
    clt_page_text(page, parts[k].figure->caption);
    fputs("</p>\n", page);
    put_rows(page, &parts[k], rows);
    fputs("<p></p>\n", page);
    status = put_pictures(page, folder, parts[k].figure, error);
  }
  return status;
}

clt_status clt_page_write(const char *folder, const clt_page_part *parts, int count, const clt_reproduction *rows,
                          clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_text text = {0};
  clt_status status = clt_file_join(folder, "reproduce.html", path, error);
  if (status == CLT_OK) {
    status = clt_text_open(&text, path, error);
  }
  if (status == CLT_OK) {
    clt_page_begin(text.to, "counterlight: the report, computed again");
    put_opening(text.to, rows);
    status = put_parts(text.to, folder, parts, count, rows, error);
    clt_page_end(text.to);
  }
  return clt_text_close(&text, status, error);
}
