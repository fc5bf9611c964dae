#include "rig/photometry/monotone.h"

void clt_monotone_fit(double *y, const double *weight, int n) {
  double mean[CLT_MONOTONE_MAX], mass[CLT_MONOTONE_MAX];
  int length[CLT_MONOTONE_MAX], blocks = 0;
  for (int i = 0; i < n; i++) {
    mean[blocks] = y[i];
    mass[blocks] = weight[i];
    length[blocks++] = 1;
    while (blocks > 1 && mean[blocks - 2] > mean[blocks - 1]) {
      double both = mass[blocks - 2] + mass[blocks - 1];
      mean[blocks - 2] = (mass[blocks - 2] * mean[blocks - 2] + mass[blocks - 1] * mean[blocks - 1]) / both;
      mass[blocks - 2] = both;
      length[blocks - 2] += length[blocks - 1];
      blocks--;
    }
  }
  for (int block = 0, i = 0; block < blocks; block++) {
    for (int k = 0; k < length[block]; k++) {
      y[i++] = mean[block];
    }
  }
}
