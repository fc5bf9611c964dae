#include "rig/timing/patch.h"

#include <math.h>

/* A frame that holds a share f of another picture has a contrast of 1 - 2 f where the two differ. */
#define STEADY 0.75
#define LEAST_CONTRAST 0.1
#define SATURATED 0.9

clt_status clt_patch_check(const clt_patch *patch, int width, int height, clt_error *error) {
  int size = CLT_PATCH_BLOCKS * patch->side;
  if (patch->side < 0 || patch->left < 0 || patch->top < 0 || patch->left + size > width ||
      patch->top + size > height) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "a patch of 4 x 4 blocks of %d cells at (%d, %d) reaches beyond the grid of %d x %d; move it, or "
                    "take smaller blocks",
                    patch->side, patch->left, patch->top, width, height);
  }
  return CLT_OK;
}

bool clt_patch_covers(const clt_patch *patch, int x, int y) {
  int size = CLT_PATCH_BLOCKS * patch->side;
  return x >= patch->left && x < patch->left + size && y >= patch->top && y < patch->top + size;
}

static int gray(long id) {
  unsigned number = (unsigned)(id & (CLT_PATCH_IDS - 1));
  return (int)(number ^ (number >> 1));
}

static int gray_inverse(int code) {
  int number = code;
  for (int shift = 1; shift < 8; shift *= 2) {
    number ^= number >> shift;
  }
  return number;
}

/* Block of a cell: bit b is bright in block 2 b and dark in 2 b + 1, or the other way round. */
static bool is_bright(int code, int block) {
  return ((code >> (block / 2)) & 1) != (block & 1);
}

void clt_patch_write(const clt_patch *patch, int width, int height, const clt_projector_info *panel, long id,
                     float *codes) {
  int kx = panel->width / width, ky = panel->height / height, size = CLT_PATCH_BLOCKS * patch->side, code = gray(id);
  for (int c = 0; c < panel->channels; c++) {
    for (int y = patch->top * ky; y < (patch->top + size) * ky; y++) {
      float *row = codes + ((size_t)c * (size_t)panel->height + (size_t)y) * (size_t)panel->width;
      int down = (y / ky - patch->top) / patch->side;
      for (int x = patch->left * kx; x < (patch->left + size) * kx; x++) {
        int across = (x / kx - patch->left) / patch->side;
        row[x] = is_bright(code, CLT_PATCH_BLOCKS * down + across) ? 1.0f : 0.0f;
      }
    }
  }
}

/* Mean sample above black of a block, over all channels; 0 where no cell of it is seen. */
static double block_mean(const clt_patch *patch, int width, const clt_footprints *footprints, const clt_frame *frame,
                         double black_level, int block) {
  double sum = 0, count = 0;
  int left = patch->left + block % CLT_PATCH_BLOCKS * patch->side,
      top = patch->top + block / CLT_PATCH_BLOCKS * patch->side;
  for (int n = 0; n < patch->side * patch->side; n++) {
    int cell = (top + n / patch->side) * width + left + n % patch->side;
    for (int64_t p = footprints->start[cell]; p < footprints->start[cell + 1]; p++) {
      const uint16_t *sample = frame->samples + (size_t)footprints->pixel[p] * (size_t)frame->channels;
      for (int c = 0; c < frame->channels; c++) {
        sum += sample[c] - black_level;
      }
      count += frame->channels;
    }
  }
  return count > 0 ? fmax(sum / count, 0) : 0;
}

clt_patch_reading clt_patch_read(const clt_patch *patch, int width, const clt_footprints *footprints,
                                 const clt_frame *frame, double black_level) {
  double least = INFINITY, most = 0, brightest = 0, full = (1 << frame->bits) - 1 - black_level;
  int code = 0;
  for (int bit = 0; bit < 8; bit++) {
    double one = block_mean(patch, width, footprints, frame, black_level, 2 * bit);
    double other = block_mean(patch, width, footprints, frame, black_level, 2 * bit + 1);
    double contrast = fabs(one - other) / fmax(one + other, 1e-9);
    code |= (one > other) << bit;
    brightest = fmax(brightest, fmax(one, other));
    least = fmin(least, contrast);
    most = fmax(most, contrast);
  }
  return (clt_patch_reading){.saturated = brightest >= SATURATED * full,
                             .legible = least >= LEAST_CONTRAST && least >= STEADY * most,
                             .id = gray_inverse(code),
                             .contrast = least};
}
