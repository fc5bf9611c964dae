/* Converts pictures on request: for each line "IN<tab>OUT<tab>CURVE" on stdin it reads IN, writes OUT, and answers with
 * a line "STATUS<tab>MESSAGE" on stdout. */
#include <stdio.h>
#include <string.h>

#include "counterlight/image.h"

static clt_status convert(const char *in, const char *out, const char *text, clt_error *error) {
  clt_curve curve;
  clt_image image = {0};
  clt_status status = clt_curve_parse(text, &curve, error);
  if (status == CLT_OK) {
    status = clt_image_read(in, &curve, &image, error);
  }
  if (status == CLT_OK) {
    status = clt_image_write(out, &curve, &image, error);
  }
  clt_image_finish(&image);
  return status;
}

int main(void) {
  char line[4096];
  while (fgets(line, sizeof line, stdin) != NULL) {
    clt_error error = {0};
    char *rest = line, *in = strsep(&rest, "\t\n"), *out = strsep(&rest, "\t\n"), *curve = strsep(&rest, "\t\n");
    if (curve == NULL) {
      return 64;
    }
    clt_status status = convert(in, out, curve, &error);
    printf("%d\t%s\n", (int)status, error.message);
    fflush(stdout);
  }
  return 0;
}
