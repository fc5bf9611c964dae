/* The demo's report: what was asked, what was seen, and how it came about, in one page without outside resources. */
#include "cli/report.h"

#include <string.h>

#include "base/file.h"
#include "base/page.h"

static const char words[] =
    "<h2>What the words mean</h2>\n<dl>\n"
    "<dt>Off by</dt><dd>The root mean square of the difference between what was seen and what was wanted, over every "
    "lit cell and colour, divided by that of the wanted picture, in linear light. The picture without compensation is "
    "first brightened or dimmed as a whole to suit it best, so that a mere gain does not count.</dd>\n"
    "<dt>The limit</dt><dd>A projector can add light but not take it away: where the walls already throw more onto a "
    "dark place than is wanted there, nothing helps. The limit is the error of the best of all drives between none and "
    "full, computed from the simulated room itself. It is a yardstick only: the compensation never saw it.</dd>\n"
    "<dt>Transport</dt><dd>How much light each place returns for each projector cell, all bounces included. It was "
    "measured here with patterns, through noisy camera frames.</dd>\n"
    "<dt>Drive, pattern</dt><dd>The light each projector cell is told to give, and the panel values that make it give "
    "that much.</dd>\n"
    "<dt>White</dt><dd>The radiance that the picture's white stands for: by default what a fully driven cell of this "
    "room shows of its own light.</dd>\n"
    "<dt>Residual</dt><dd>How far a solver still is from its equations after an iteration, relative to the "
    "light that is wanted.</dd>\n</dl>\n";

static void put_verdict(FILE *page, const demo *d) {
  fprintf(page,
          "<p class=\"lead\">Without compensation the picture is <b>%.1f&nbsp;%%</b> off; with it "
          "<b>%.2f&nbsp;%%</b>, and no drive between 0 and 1 could do better than %.2f&nbsp;%%.</p>\n",
          100 * d->before.error, 100 * d->after.error, 100 * d->error_limit);
}

static void put_opening(FILE *page, const demo *d) {
  const clt_provenance *origin = clt_transport_origin(d->transport);
  fputs("<h1>The picture, not the bouncing</h1>\n", page);
  put_verdict(page, d);
  fputs(
      "<p class=\"soft\">Light from a projector bounces between the surfaces of a room: corners glow, walls bleed into "
      "each other, blacks turn grey. counterlight measured how this room (<code>",
      page);
  const char *slash = strrchr(d->scene, '/');
  clt_page_text(page, slash ? slash + 1 : d->scene);
  fprintf(page,
          "</code>, simulated, %d&nbsp;&times;&nbsp;%d cells) carries light with %d patterns and %d camera frames, "
          "inverted that, and projected the pattern below.</p>\n",
          d->grid.width, d->grid.height, origin->patterns, origin->frames);
}

static clt_status put_figure(FILE *page, const demo *d, const char *file, const char *title, const char *caption,
                             clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = clt_file_join(d->folder, file, path, error);
  if (status) {
    return status;
  }
  fputs("<figure><img alt=\"", page);
  clt_page_text(page, title);
  fputs("\" src=\"", page);
  status = clt_page_embed(page, path, "png", error);
  fprintf(page, "\"><figcaption><b>%s</b><span>%s</span></figcaption></figure>\n", title, caption);
  return status;
}

static clt_status put_pictures(FILE *page, const demo *d, clt_error *error) {
  char before[160], after[160], pattern[160];
  snprintf(before, sizeof before, "%.1f&nbsp;%% off, at the brightness that suits it best (&times;&nbsp;%.2f)",
           100 * d->before.error, d->before.gain);
  snprintf(after, sizeof after, "%.2f&nbsp;%% off, as photographed (mean of %d)", 100 * d->after.error,
           DEMO_OBSERVATIONS);
  snprintf(pattern, sizeof pattern, "panel values; %.0f&nbsp;%% of the cells are fully off or fully on",
           100 * d->result.clipped_fraction);
  fputs("<h2>What was asked, and what was seen</h2>\n<div class=\"pair\">\n", page);
  clt_status status = put_figure(page, d, "target.png", "Asked for", "the target", error);
  if (!status) {
    status = put_figure(page, d, "pattern.png", "The pattern that makes it appear", pattern, error);
  }
  if (!status) {
    status = put_figure(page, d, "uncompensated.png", "Seen without compensation", before, error);
  }
  if (!status) {
    status = put_figure(page, d, "compensated.png", "Seen with compensation", after, error);
  }
  fputs("</div>\n", page);
  return status;
}

static clt_status put_maps(FILE *page, const demo *d, clt_error *error) {
  fputs("<h2>Where it is off</h2>\n<div class=\"pair\">\n", page);
  clt_status status =
      put_figure(page, d, "error-before.png", "Error without compensation", "distance from the target", error);
  if (!status) {
    status = put_figure(page, d, "error-after.png", "Error with compensation", "the same colour scale", error);
  }
  fputs("</div>\n", page);
  return status ? status : cli_report_scale(page, d->map_top, error);
}

static void put_convergence(FILE *page, const demo *d) {
  const clt_solve_result *solve = &d->result.solve;
  fputs("<h2>How the solver got there</h2>\n<p>", page);
  clt_page_text(page, solve->method);
  fprintf(page, ", %d iterations in %.0f&nbsp;ms: ", solve->iterations, 1e3 * solve->seconds);
  clt_page_text(page, solve->reason);
  fputs(".</p>\n", page);
  if (d->race.count > 0) {
    fputs("<p class=\"soft\">The methods that take this transport, of six, on the same target. The bounded one starts "
          "from a "
          "linear solution and ends at the limit, as it may not ask for less than no light; the others go below it "
          "with drives "
          "that no projector can show.</p>\n",
          page);
    cli_report_curves(page, d->race.runs, d->race.count);
  }
}

static void put_timings(FILE *page, const demo *d) {
  const struct {
    const char *step, *remark;
    double seconds;
  } rows[] = {
      {"Computing the simulated room", "geometry and every bounce, for the frames to come from", d->timings.scene},
      {"Measuring the transport", "patterns, exposures, frames", d->timings.acquire},
      {"Certificate", "bounds of the spectrum, once per transport", d->timings.certify},
      {"Solving", "once per picture", d->result.solve.seconds},
      {"Photographing", "both pictures", d->timings.photograph},
      {"The limit", "for this report only", d->timings.reference},
  };
  fputs("<h2>Time</h2>\n<table>\n", page);
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    fprintf(page, "<tr><td>%s<td class=\"soft\">%s<td class=\"n\">%.3g&nbsp;%s</tr>\n", rows[i].step, rows[i].remark,
            rows[i].seconds < 1 ? 1e3 * rows[i].seconds : rows[i].seconds, rows[i].seconds < 1 ? "ms" : "s");
  }
  fputs("</table>\n", page);
}

static clt_status put_page(FILE *page, const demo *d, clt_error *error) {
  clt_page_begin(page, "counterlight: what the room shows");
  put_opening(page, d);
  clt_status status = put_pictures(page, d, error);
  if (!status) {
    status = put_maps(page, d, error);
  }
  put_convergence(page, d);
  put_timings(page, d);
  fputs(words, page);
  fprintf(page, "<p class=\"soft\">counterlight %s. All numbers: <code>summary.json</code>.</p>\n", CLT_VERSION);
  clt_page_end(page);
  return status;
}

clt_status cli_report_write(const char *path, const demo *d, clt_error *error) {
  clt_text text;
  clt_status status = clt_text_open(&text, path, error);
  if (!status) {
    status = put_page(text.to, d, error);
  }
  return clt_text_close(&text, status, error);
}
