#include "base/page.h"

#include <errno.h>
#include <stdint.h>
#include <string.h>

static const char head[] = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
                           "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
                           "<meta name=\"color-scheme\" content=\"light dark\">\n"
                           "<title>";

static const char style[] =
    "</title>\n<style>\n"
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
    ".r0{--run:#7c8798}.r1{--run:#2a9d8f}.r2{--run:#3b82f6}.r3{--run:#a855f7}"
    ".r4{--run:#d4a017}.r5{--run:var(--mark)}"
    ".r4 polyline{stroke-dasharray:7 5}\n"
    ".wide{overflow-x:auto}.scale{max-width:700px;margin:16px auto 0}.curve{max-width:860px}\n"
    "dl{margin:0;max-width:52em}dt{font-weight:600;margin-top:.9em}dd{margin:0;color:var(--soft)}\n"
    "</style></head><body><main>\n";

void clt_page_begin(FILE *page, const char *title) {
  fputs(head, page);
  clt_page_text(page, title);
  fputs(style, page);
}

void clt_page_end(FILE *page) {
  fputs("</main></body></html>\n", page);
}

static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/* Three bytes are four digits of six bits; a shorter end is filled with '=' (RFC 4648). */
static void put_base64(FILE *page, const unsigned char *bytes, size_t count) {
  uint32_t bits = (uint32_t)bytes[0] << 16;
  bits |= count > 1 ? (uint32_t)bytes[1] << 8 : 0;
  bits |= count > 2 ? bytes[2] : 0;
  for (size_t i = 0; i < 4; i++) {
    putc(i <= count ? digits[bits >> (18 - 6 * i) & 63] : '=', page);
  }
}

clt_status clt_page_embed(FILE *page, const char *path, const char *type, clt_error *error) {
  FILE *file = fopen(path, "rb");
  if (!file) {
    return clt_fail(error, CLT_FAILED, "%s: cannot be read back for the report: %s", path, strerror(errno));
  }
  unsigned char bytes[3];
  size_t count;
  fprintf(page, "data:image/%s;base64,", type);
  while ((count = fread(bytes, 1, sizeof bytes, file)) > 0) {
    put_base64(page, bytes, count);
  }
  int failed = ferror(file);
  fclose(file);
  return failed ? clt_fail(error, CLT_FAILED, "%s: cannot be read back for the report", path) : CLT_OK;
}

void clt_page_text(FILE *page, const char *text) {
  for (; *text; text++) {
    switch (*text) {
    case '&':
      fputs("&amp;", page);
      break;
    case '<':
      fputs("&lt;", page);
      break;
    case '>':
      fputs("&gt;", page);
      break;
    case '"':
      fputs("&quot;", page);
      break;
    default:
      putc(*text, page);
    }
  }
}
