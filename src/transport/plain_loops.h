/* The loops over plain numbers of one type. plain_kernels.c defines REAL, NAME(of) and, for x86-64, TAKE(at), four
 * numbers as doubles, and includes this once for each type. */

static void NAME(dot_from)(const REAL *const row[CLT_PLAIN_ROWS], const double *x, size_t done, size_t count,
                           double lane[CLT_PLAIN_ROWS][LANES], double sum[CLT_PLAIN_ROWS]) {
  for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
    for (size_t k = done; k < count; k++) {
      lane[r][k - done] += (double)row[r][k] * x[k];
    }
    sum[r] = fold(lane[r]);
  }
}

static void NAME(dot_portable)(const REAL *const row[CLT_PLAIN_ROWS], const double *x, size_t count,
                               double sum[CLT_PLAIN_ROWS]) {
  double lane[CLT_PLAIN_ROWS][LANES] = {{0}};
  size_t k = 0;
  for (; k + LANES <= count; k += LANES) {
    for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
      for (size_t l = 0; l < LANES; l++) {
        lane[r][l] += (double)row[r][k + l] * x[k + l];
      }
    }
  }
  NAME(dot_from)(row, x, k, count, lane, sum);
}

static void NAME(add_from)(const REAL *const row[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], size_t done,
                           size_t count, double *x) {
  const REAL *a = row[0], *b = row[1], *c = row[2], *d = row[3];
  for (size_t k = done; k < count; k++) {
    x[k] += (y[0] * (double)a[k] + y[1] * (double)b[k]) + (y[2] * (double)c[k] + y[3] * (double)d[k]);
  }
}

static void NAME(add_portable)(const REAL *const row[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], size_t count,
                               double *x) {
  NAME(add_from)(row, y, 0, count, x);
}

#if defined(__x86_64__)
CLT_AVX2 static void NAME(dot_avx2)(const REAL *const row[CLT_PLAIN_ROWS], const double *x, size_t count,
                                    double sum[CLT_PLAIN_ROWS]) {
  __m256d low[CLT_PLAIN_ROWS], high[CLT_PLAIN_ROWS];
  double lane[CLT_PLAIN_ROWS][LANES];
  size_t k = 0;
  for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
    low[r] = high[r] = _mm256_setzero_pd();
  }
  for (; k + LANES <= count; k += LANES) {
    const __m256d xl = _mm256_loadu_pd(x + k), xh = _mm256_loadu_pd(x + k + 4);
#pragma GCC unroll 4
    for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
      low[r] = _mm256_add_pd(low[r], _mm256_mul_pd(TAKE(row[r] + k), xl));
      high[r] = _mm256_add_pd(high[r], _mm256_mul_pd(TAKE(row[r] + k + 4), xh));
    }
  }
  for (int r = 0; r < CLT_PLAIN_ROWS; r++) {
    _mm256_storeu_pd(lane[r], low[r]);
    _mm256_storeu_pd(lane[r] + 4, high[r]);
  }
  _mm256_zeroupper(); /* else whatever runs next in SSE drags the upper halves along, at a third of its speed */
  NAME(dot_from)(row, x, k, count, lane, sum);
}

CLT_AVX2 static void NAME(add_avx2)(const REAL *const row[CLT_PLAIN_ROWS], const double y[CLT_PLAIN_ROWS], size_t count,
                                    double *x) {
  const __m256d ya = _mm256_set1_pd(y[0]), yb = _mm256_set1_pd(y[1]);
  const __m256d yc = _mm256_set1_pd(y[2]), yd = _mm256_set1_pd(y[3]);
  size_t k = 0;
  for (; k + 4 <= count; k += 4) {
    __m256d front = _mm256_add_pd(_mm256_mul_pd(ya, TAKE(row[0] + k)), _mm256_mul_pd(yb, TAKE(row[1] + k)));
    __m256d back = _mm256_add_pd(_mm256_mul_pd(yc, TAKE(row[2] + k)), _mm256_mul_pd(yd, TAKE(row[3] + k)));
    _mm256_storeu_pd(x + k, _mm256_add_pd(_mm256_loadu_pd(x + k), _mm256_add_pd(front, back)));
  }
  _mm256_zeroupper();
  NAME(add_from)(row, y, k, count, x);
}
#endif
