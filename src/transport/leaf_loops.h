/* The loops over the leaves of a hierarchy in vectors of one width. leaf_kernels.c defines WIDE, doubles in a vector,
 * NAME(of), FOR, the attributes of functions for the processor that has them, and TAKE(at), floats as such a vector,
 * and includes this once for each. */

typedef double NAME(wide) __attribute__((vector_size(WIDE * sizeof(double))));

FOR static inline NAME(wide) NAME(doubles)(const double *at) {
  NAME(wide) value;
  memcpy(&value, at, sizeof value);
  return value;
}

FOR static inline double NAME(fold)(const NAME(wide) parts[LANES / WIDE]) {
  double lane[LANES];
  memcpy(lane, parts, sizeof lane);
  return (lane[0] + lane[2]) + (lane[1] + lane[3]);
}

/* Over a span: the sums of cells x, u cells x and weight x. */
FOR static inline void NAME(sum_span)(const float *cells, const float *weight, const double *x, const double *u,
                                      size_t count, double sum[3]) {
  NAME(wide) even[LANES / WIDE] = {{0}}, tilted[LANES / WIDE] = {{0}}, weighted[LANES / WIDE] = {{0}};
  size_t k = 0;
  for (; k + LANES <= count; k += LANES) {
    for (size_t part = 0; part < LANES / WIDE; part++) {
      const size_t at = k + part * WIDE;
      const NAME(wide) in = NAME(doubles)(x + at), value = TAKE(cells + at) * in;
      even[part] += value;
      tilted[part] += NAME(doubles)(u + at) * value;
      weighted[part] += TAKE(weight + at) * in;
    }
  }
  double rest[3] = {0};
  for (; k < count; k++) {
    const double value = (double)cells[k] * x[k];
    rest[0] += value;
    rest[1] += u[k] * value;
    rest[2] += (double)weight[k] * x[k];
  }
  sum[0] = NAME(fold)(even) + rest[0];
  sum[1] = NAME(fold)(tilted) + rest[1];
  sum[2] = NAME(fold)(weighted) + rest[2];
}

FOR static void NAME(sum)(const clt_leaf_in *in, const clt_span *span, size_t spans, double *sums) {
  for (size_t k = 0; k < spans; k++) {
    const size_t first = (size_t)span[k].first, count = span[k].count;
    const float *cells = in->cells + first, *weight = in->weight + first * in->weight_step;
    const double *x = in->x + first * in->x_step, v = in->place[span[k].v];
    double of[3], *to = sums + CLT_LEAF_SUMS * span[k].part;
    foresee_floats(cells, count);
    foresee_floats(weight, count);
    foresee_doubles(x, count);
    NAME(sum_span)(cells, weight, x, in->place + span[k].u, count, of);
    to[0] += of[0];
    to[1] += of[1];
    to[2] += v * of[0];
    to[3] += v * of[1];
    to[4] += of[2];
  }
}

FOR static void NAME(spread)(const clt_leaf_out *out, const clt_span *span, size_t spans) {
  const double mean = out->mean;
  for (size_t s = 0; s < spans; s++) {
    const size_t first = (size_t)span[s].first, count = span[s].count;
    const float *own = out->own + first, *flood = out->flood + first * out->flood_step, *cells = out->cells + first;
    const double *x = out->x + first * out->x_step, *u = out->place + span[s].u, v = out->place[span[s].v];
    const double *f = out->f + CLT_PLAIN_ROWS * out->leaf[span[s].part];
    const double even = f[0] + v * f[2], tilted = f[1] + v * f[3];
    double *y = out->y + first;
    foresee_floats(cells, count);
    foresee_floats(own, count);
    foresee_floats(flood, count);
    size_t k = 0;
    for (; k + WIDE <= count; k += WIDE) {
      const NAME(wide) far = TAKE(cells + k) * (even + tilted * NAME(doubles)(u + k));
      const NAME(wide) all = (TAKE(own + k) * NAME(doubles)(x + k) + TAKE(flood + k) * mean) + far;
      memcpy(y + k, &all, sizeof all);
    }
    for (; k < count; k++) {
      y[k] = ((double)own[k] * x[k] + (double)flood[k] * mean) + (double)cells[k] * (even + tilted * u[k]);
    }
  }
}
