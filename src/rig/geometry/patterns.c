#include "rig/geometry/patterns.h"

#include <stddef.h>
#include <string.h>

enum { SIDE_MAX = 1 << CLT_GRAY_BITS_MAX };

static int bits_for(int size) {
  int bits = 1;
  while (1 << bits < size) {
    bits++;
  }
  return bits;
}

clt_status clt_gray_init(clt_gray *gray, int panel_width, int panel_height, clt_error *error) {
  if (panel_width < 2 || panel_height < 2 || panel_width > SIDE_MAX || panel_height > SIDE_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "a panel of %d x %d pixels; each side is 2 to %d", panel_width, panel_height,
                    SIDE_MAX);
  }
  *gray = (clt_gray){panel_width, panel_height, {bits_for(panel_width), bits_for(panel_height)}};
  return CLT_OK;
}

clt_status clt_gray_init_counted(clt_gray *gray, int panel_width, int panel_height, int pictures, clt_error *error) {
  clt_status status = clt_gray_init(gray, panel_width, panel_height, error);
  if (status != CLT_OK || pictures == clt_gray_pictures(gray)) {
    return status;
  }
  int bits = pictures / 4;
  if (pictures % 4 != 0 || bits < gray->bits[0] || bits < gray->bits[1] || bits > CLT_GRAY_BITS_MAX) {
    return clt_fail(
        error, CLT_BAD_INPUT,
        "%d pictures are no Gray code of a panel of %d x %d pixels, which takes %d columns and %d rows bits, "
        "each with its inverse: %d pictures; check the panel's size",
        pictures, panel_width, panel_height, gray->bits[0], gray->bits[1], clt_gray_pictures(gray));
  }
  gray->bits[0] = gray->bits[1] = bits;
  return CLT_OK;
}

int clt_gray_pictures(const clt_gray *gray) {
  return 2 * (gray->bits[0] + gray->bits[1]);
}

clt_gray_picture clt_gray_picture_at(const clt_gray *gray, int index) {
  int axis = index >= 2 * gray->bits[0], within = index - axis * 2 * gray->bits[0];
  return (clt_gray_picture){axis, gray->bits[axis] - 1 - within / 2, within % 2 == 1};
}

int clt_gray_pair(const clt_gray *gray, int axis, int bit) {
  return axis * gray->bits[0] + gray->bits[axis] - 1 - bit;
}

bool clt_gray_lit(int coordinate, int bit) {
  return ((coordinate ^ coordinate >> 1) >> bit & 1) != 0;
}

void clt_gray_draw(const clt_gray *gray, int index, int channels, float *codes) {
  clt_gray_picture picture = clt_gray_picture_at(gray, index);
  size_t pixels = (size_t)gray->panel_width * (size_t)gray->panel_height;
  float *code = codes;
  for (int y = 0; y < gray->panel_height; y++) {
    for (int x = 0; x < gray->panel_width; x++) {
      *code++ = clt_gray_lit(picture.axis == 0 ? x : y, picture.bit) != picture.inverse;
    }
  }
  for (int c = 1; c < channels; c++) {
    memcpy(codes + (size_t)c * pixels, codes, pixels * sizeof *codes);
  }
}
