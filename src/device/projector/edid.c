#include <string.h>

#include "device/projector/desktop.h"

enum { DESCRIPTORS = 54, DESCRIPTOR = 18, BLOCK = 128, TEXT = 13, NAME_TAG = 0xfc };

void clt_edid_model(const unsigned char *edid, size_t bytes, char *model, size_t size) {
  static const unsigned char header[8] = {0, 255, 255, 255, 255, 255, 255, 0};
  model[0] = '\0';
  if (bytes < BLOCK || memcmp(edid, header, sizeof header) != 0) {
    return;
  }
  for (size_t at = DESCRIPTORS; at + DESCRIPTOR < BLOCK; at += DESCRIPTOR) {
    const unsigned char *from = edid + at;
    if (from[0] != 0 || from[1] != 0 || from[3] != NAME_TAG) {
      continue;
    }
    size_t length = 0;
    while (length < TEXT && length + 1 < size && from[5 + length] >= ' ' && from[5 + length] < 127) {
      model[length] = (char)from[5 + length];
      length++;
    }
    model[length] = '\0';
  }
}
