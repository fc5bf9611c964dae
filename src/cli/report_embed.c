/* What a page takes in from outside: files as base64, texts with HTML's own characters escaped. */
#include <errno.h>
#include <stdint.h>
#include <string.h>

#include "cli/report.h"

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

clt_status cli_embed_png(FILE *page, const char *path, clt_error *error) {
  FILE *file = fopen(path, "rb");
  if (!file) {
    return clt_fail(error, CLT_FAILED, "%s: cannot be read back for the report: %s", path, strerror(errno));
  }
  unsigned char bytes[3];
  size_t count;
  fputs("data:image/png;base64,", page);
  while ((count = fread(bytes, 1, sizeof bytes, file)) > 0) {
    put_base64(page, bytes, count);
  }
  int failed = ferror(file);
  fclose(file);
  return failed ? clt_fail(error, CLT_FAILED, "%s: cannot be read back for the report", path) : CLT_OK;
}

void cli_escape(FILE *page, const char *text) {
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
