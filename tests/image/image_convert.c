/* image_convert IN OUT [CURVE]: reads a picture and writes it as another; exits with the status, its message on stderr.
 */
#include <stdio.h>

#include "counterlight/image.h"

int main(int count, char **arguments) {
  clt_curve curve = {.kind = CLT_CURVE_SRGB};
  clt_image image = {0};
  clt_error error = {0};
  if (count < 3 || (count > 3 && clt_curve_parse(arguments[3], &curve, &error) != CLT_OK)) {
    fprintf(stderr, "usage: image_convert IN OUT [CURVE]\n");
    return 64;
  }
  clt_status status = clt_image_read(arguments[1], &curve, &image, &error);
  if (status == CLT_OK) {
    status = clt_image_write(arguments[2], &curve, &image, &error);
  }
  if (status != CLT_OK) {
    fprintf(stderr, "%s\n", error.message);
  }
  clt_image_finish(&image);
  return status;
}
