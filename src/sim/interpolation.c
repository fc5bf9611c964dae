#include "sim/interpolation.h"

/* cos((2 number + 1) pi / (2 order)) */
static const double nodes[6][6] = {
    {0.0},
    {0.7071067811865476, -0.7071067811865475},
    {0.8660254037844387, 0.0, -0.8660254037844387},
    {0.9238795325112867, 0.38268343236508984, -0.3826834323650897, -0.9238795325112867},
    {0.9510565162951535, 0.5877852522924731, 0.0, -0.587785252292473, -0.9510565162951535},
    {0.9659258262890683, 0.7071067811865476, 0.25881904510252074, -0.25881904510252063, -0.7071067811865475,
     -0.9659258262890682},
};

double clt_interpolation_node(int order, int number) {
  return nodes[order - 1][number];
}

void clt_interpolation_weights(int order, double at, double weights[CLT_ORDER_MAX]) {
  for (int a = 0; a < order; a++) {
    weights[a] = 1.0;
    for (int b = 0; b < order; b++) {
      double other = clt_interpolation_node(order, b);
      weights[a] *= b == a ? 1.0 : (at - other) / (clt_interpolation_node(order, a) - other);
    }
  }
}

void clt_interpolation_plane(int order, const double at[2], double weights[CLT_NODES]) {
  double across[CLT_ORDER_MAX], along[CLT_ORDER_MAX];
  clt_interpolation_weights(order, at[0], across);
  clt_interpolation_weights(order, at[1], along);
  for (int k = 0; k < order * order; k++) {
    weights[k] = across[k / order] * along[k % order];
  }
}
