#include "sim/effects/gaussian.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

/* Products that one thread adds up sooner than several have met on a busy machine. */
enum { FEW_PRODUCTS = 1 << 20 };

void clt_gaussian_init(clt_gaussian *gaussian, double sigma) {
  double scale = 1.0 / (sigma * sqrt(2.0)), sum = 0.0;
  gaussian->reach = (int)ceil(4.0 * sigma);
  for (int k = 0; k <= gaussian->reach; k++) {
    gaussian->weight[k] = 0.5 * (erfc((k - 0.5) * scale) - erfc((k + 0.5) * scale));
    sum += (k == 0 ? 1.0 : 2.0) * gaussian->weight[k];
  }
  for (int k = 0; k <= gaussian->reach; k++) {
    gaussian->weight[k] /= sum;
  }
}

/* Index of what lies at `index` beside values 0..count-1 that are mirrored at their outer edges, again and again. */
static int mirrored(int index, int count) {
  int within = index % (2 * count);
  within += within < 0 ? 2 * count : 0;
  return within < count ? within : 2 * count - 1 - within;
}

/* to[i * step] = sum over k of weight[|k|] from[(i + k) * step] */
static void blur_line(const clt_gaussian *gaussian, const float *from, float *to, int count, size_t step) {
  for (int i = 0; i < count; i++) {
    double sum = gaussian->weight[0] * (double)from[(size_t)i * step];
    for (int k = 1; k <= gaussian->reach; k++) {
      int before = i >= k ? i - k : mirrored(i - k, count), after = i + k < count ? i + k : mirrored(i + k, count);
      sum += gaussian->weight[k] * ((double)from[(size_t)before * step] + (double)from[(size_t)after * step]);
    }
    to[(size_t)i * step] = (float)sum;
  }
}

void clt_gaussian_blur(const clt_gaussian *gaussian, int planes, int height, int width, float *values, float *scratch) {
  bool threads_pay = (double)planes * height * width * gaussian->reach > FEW_PRODUCTS;
  size_t across = (size_t)width, plane = across * (size_t)height;
#pragma omp parallel for schedule(static) if (threads_pay)
  for (int row = 0; row < planes * height; row++) {
    blur_line(gaussian, &values[(size_t)row * across], &scratch[(size_t)row * across], width, 1);
  }
#pragma omp parallel for schedule(static) if (threads_pay)
  for (int column = 0; column < planes * width; column++) {
    size_t first = (size_t)(column / width) * plane + (size_t)(column % width);
    blur_line(gaussian, &scratch[first], &values[first], height, across);
  }
}
