/* Polynomial interpolation in Chebyshev points on -1..1. */
#ifndef CLT_SIM_INTERPOLATION_H
#define CLT_SIM_INTERPOLATION_H

/* An interpolation of order k in two dimensions has k x k nodes: node a * k + b stands at (node a, node b). */
enum { CLT_ORDER_MAX = 5, CLT_NODES = CLT_ORDER_MAX * CLT_ORDER_MAX };

/* Node `number` of `order`: cos((2 number + 1) pi / (2 order)). */
double clt_interpolation_node(int order, int number);
/* The Lagrange polynomials of the order's nodes at a place: order values, whose sum is 1. */
void clt_interpolation_weights(int order, double at, double weights[CLT_ORDER_MAX]);
/* The nodes' order^2 products of those at a place of the plane. */
void clt_interpolation_plane(int order, const double at[2], double weights[CLT_NODES]);

#endif
