#include "acquire/partition.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

/* What is uneven in a block shows in the means over so many strips across and down it. */
enum { STRIPS = 4 };

clt_status clt_partition_init(clt_partition *partition, int width, int height, int channels, const double *scale,
                              int32_t most, clt_error *error) {
  const size_t room = (size_t)most, cells = (size_t)width * (size_t)height;
  *partition = (clt_partition){.width = width,
                               .height = height,
                               .channels = channels,
                               .scale = scale,
                               .count = 1,
                               .most = most,
                               .box = clt_alloc(room, sizeof(clt_block)),
                               .label = clt_alloc(cells, sizeof(int32_t)),
                               .mean = clt_alloc(room * room, sizeof(double)),
                               .across = clt_alloc(room * room, sizeof(double)),
                               .down = clt_alloc(room * room, sizeof(double)),
                               .variance = clt_alloc(room, sizeof(double))};
  if (partition->box == NULL || partition->label == NULL || partition->mean == NULL || partition->across == NULL ||
      partition->down == NULL || partition->variance == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for %d blocks over %zu cells", most, cells);
  }
  partition->box[0] = (clt_block){0, 0, width, height};
  return CLT_OK;
}

void clt_partition_finish(clt_partition *partition) {
  free(partition->box);
  free(partition->label);
  free(partition->mean);
  free(partition->across);
  free(partition->down);
  free(partition->variance);
}

/* The variance of the means over `strips` strips of a direction, from their sums and numbers of values. */
static double spread(const double sum[STRIPS], const double count[STRIPS], double mean) {
  double square = 0, strips = 0;
  for (int k = 0; k < STRIPS; k++) {
    if (count[k] > 0) {
      square += (sum[k] / count[k] - mean) * (sum[k] / count[k] - mean);
      strips += 1;
    }
  }
  return square / strips;
}

void clt_partition_look(clt_partition *partition, int32_t b, int32_t a, const float *light) {
  const clt_block box = partition->box[b];
  const size_t cells = (size_t)partition->width * (size_t)partition->height;
  double across[STRIPS] = {0}, down[STRIPS] = {0}, wide[STRIPS] = {0}, high[STRIPS] = {0}, whole = 0;
  for (int y = 0; y < box.height; y++) {
    const size_t first = (size_t)(box.y + y) * (size_t)partition->width + (size_t)box.x;
    for (int x = 0; x < box.width; x++) {
      double value = 0;
      for (int c = 0; c < partition->channels; c++) {
        value += (double)light[(size_t)c * cells + first + (size_t)x] / partition->scale[c];
      }
      across[x * STRIPS / box.width] += value;
      down[y * STRIPS / box.height] += value;
      whole += value;
    }
    high[y * STRIPS / box.height] += box.width;
  }
  for (int x = 0; x < box.width; x++) {
    wide[x * STRIPS / box.width] += box.height;
  }
  const size_t at = (size_t)b * (size_t)partition->most + (size_t)a;
  partition->mean[at] = whole / ((double)box.width * box.height);
  partition->across[at] = spread(across, wide, partition->mean[at]);
  partition->down[at] = spread(down, high, partition->mean[at]);
}

/* A variance of means less what the noise of the values makes of it: (strips - 1) / cells of a value's variance, and
 * room for its own spread. */
static double beyond_noise(const clt_partition *partition, int32_t b, int32_t a, double variance) {
  const clt_block box = partition->box[b];
  return fmax(variance - 8 * partition->variance[a] / ((double)box.width * box.height), 0);
}

/* What is uneven in b from what is uneven in a is not measured. As if light were a product of how b shows a and how a
 * shows b: mean * (uneven part of a's light in b) * (uneven part of b's light in a), squared and summed over b.
 * Along its longer side b counts as at least as uneven as along the shorter: light that falls off near a long edge
 * falls off along it as well, which a source as long as the edge does not show. */
static double unresolved(const clt_partition *partition, int32_t b, int32_t a, bool down) {
  const size_t here = (size_t)b * (size_t)partition->most + (size_t)a;
  const size_t there = (size_t)a * (size_t)partition->most + (size_t)b;
  const clt_block box = partition->box[b];
  const bool longer = down ? box.height > box.width : box.width >= box.height;
  const double *ways[2] = {down ? partition->down : partition->across, down ? partition->across : partition->down};
  double own = beyond_noise(partition, b, a, ways[0][here]);
  own = longer ? 1.001 * fmax(own, beyond_noise(partition, b, a, ways[1][here])) : own;
  const double other =
      beyond_noise(partition, a, b, partition->across[there]) + beyond_noise(partition, a, b, partition->down[there]);
  const double mean = partition->mean[there];
  return other > 0 ? own * (mean > 0 ? fmin(other / (mean * mean), 1) : 1) * (double)box.width * box.height : 0;
}

double clt_partition_choose(const clt_partition *partition, int32_t *block, bool *down) {
  double best = 0;
  for (int32_t b = 0; b < partition->count; b++) {
    for (int way = 0; way < 2; way++) {
      double sum = 0;
      for (int32_t a = 0; a < partition->count; a++) {
        sum += unresolved(partition, b, a, way == 1);
      }
      if (sum > best && (way == 1 ? partition->box[b].height : partition->box[b].width) > 1) {
        best = sum;
        *block = b;
        *down = way == 1;
      }
    }
  }
  const double cells = (double)partition->width * partition->height;
  return sqrt(best / cells);
}

int32_t clt_partition_cut(clt_partition *partition, int32_t block, bool down) {
  clt_block *box = &partition->box[block], half = *box;
  if (down) {
    half.height = box->height / 2;
    box->height -= half.height;
    half.y += box->height;
  } else {
    half.width = box->width / 2;
    box->width -= half.width;
    half.x += box->width;
  }
  const int32_t number = partition->count++;
  partition->box[number] = half;
  for (int y = half.y; y < half.y + half.height; y++) {
    for (int x = half.x; x < half.x + half.width; x++) {
      partition->label[y * partition->width + x] = number;
    }
  }
  return number;
}
