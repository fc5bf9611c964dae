/* The demo's report: what was asked, what was seen, and how it came about, in one page without outside resources. */
#include "cli/report.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"

static const char head[] =
    "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
    "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
    "<meta name=\"color-scheme\" content=\"light dark\">\n"
    "<title>counterlight: what the room shows</title>\n<style>\n"
    ":root{--paper:#fbfaf7;--ink:#22242a;--soft:#6a6d76;--line:#dddad2;--card:#ffffff;--mark:#c2410c}\n"
    "@media (prefers-color-scheme:dark){:root{--paper:#14151a;--ink:#e8e6e1;--soft:#9a9ca6;--line:#2c2e37;"
    "--card:#1c1e25;--mark:#fb923c}}\n"
    "*{box-sizing:border-box}\n"
    "body{margin:0;background:var(--paper);color:var(--ink);font:17px/1.55 system-ui,\"Segoe UI\",\"DejaVu Sans\","
    "sans-serif}\n"
    "main{max-width:1080px;margin:0 auto;padding:48px 24px 72px}\n"
    "h1{font-size:2.1rem;line-height:1.15;margin:0 0 .4em;letter-spacing:-.02em}\n"
    "h2{font-size:1.15rem;margin:2.6em 0 .7em}\n"
    ".lead{font-size:1.28rem;line-height:1.45;max-width:46em;margin:0 0 .5em}.lead b{color:var(--mark)}\n"
    ".soft,figcaption span{color:var(--soft)}\n"
    ".pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(420px,100%),1fr));gap:22px}\n"
    "figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:10px;overflow:hidden}\n"
    "figure img{display:block;width:100%;image-rendering:pixelated;background:#000}\n"
    "figcaption{padding:10px 14px 12px;line-height:1.4}figcaption b{display:block}figcaption span{font-size:.88rem}\n"
    "table{border-collapse:collapse;width:100%}td{padding:7px 12px 7px 0;border-bottom:1px solid var(--line);"
    "vertical-align:top}\n"
    "td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}\n"
    "svg{display:block;width:100%;height:auto}svg text{fill:var(--soft);font-size:13px}svg .title{fill:var(--ink)}\n"
    "svg .power{font-size:10px}svg .grid{stroke:var(--line)}svg polyline{fill:none;stroke-width:2.2;"
    "stroke-linejoin:round}.run polyline{stroke:var(--run)}.run circle{fill:var(--run)}\n"
    ".r0{--run:#7c8798}.r1{--run:#2a9d8f}.r2{--run:#3b82f6}.r3{--run:var(--mark)}"
    ".r2 polyline{stroke-dasharray:7 5}\n"
    ".scale{max-width:700px;margin:16px auto 0}.curve{max-width:860px}\n"
    "dl{margin:0;max-width:52em}dt{font-weight:600;margin-top:.9em}dd{margin:0;color:var(--soft)}\n"
    "</style></head><body><main>\n";

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
  cli_escape(page, slash ? slash + 1 : d->scene);
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
  cli_escape(page, title);
  fputs("\" src=\"", page);
  status = cli_embed_png(page, path, error);
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
  cli_escape(page, solve->method);
  fprintf(page, ", %d iterations in %.0f&nbsp;ms: ", solve->iterations, 1e3 * solve->seconds);
  cli_escape(page, solve->reason);
  fputs(".</p>\n", page);
  if (d->race.count > 0) {
    fputs(
        "<p class=\"soft\">Every method that takes this transport, on the same target. The bounded one starts from a "
        "linear "
        "solution and ends at the limit, as it may not ask for less than no light; the others go below it with drives "
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
  fputs(head, page);
  put_opening(page, d);
  clt_status status = put_pictures(page, d, error);
  if (!status) {
    status = put_maps(page, d, error);
  }
  put_convergence(page, d);
  put_timings(page, d);
  fputs(words, page);
  fprintf(page,
          "<p class=\"soft\">counterlight %s. All numbers: <code>summary.json</code>.</p>\n</main></body></html>\n",
          CLT_VERSION);
  return status;
}

clt_status cli_report_write(const char *path, const demo *d, clt_error *error) {
  char *text = NULL;
  size_t size = 0;
  FILE *page = open_memstream(&text, &size);
  if (!page) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for the report: %s", path, strerror(errno));
  }
  clt_status status = put_page(page, d, error);
  if (fclose(page) && !status) {
    status = clt_fail(error, CLT_FAILED, "%s: out of memory for the report", path);
  }
  if (!status) {
    status = clt_file_write(path, text, size, error);
  }
  free(text);
  return status;
}
