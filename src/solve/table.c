/* The methods, in the order in which they are listed. */
#include <string.h>

#include "solve/method.h"

const clt_method *const clt_methods[] = {
    &clt_method_series, &clt_method_jacobi, &clt_method_damped, &clt_method_chebyshev, &clt_method_pcg,
    &clt_method_deflated_pcg, &clt_method_gmres, &clt_method_lsmr, &clt_method_bounded,
    /* those that need the entries of T */
    &clt_method_gauss_seidel, &clt_method_sor, &clt_method_southwell, &clt_method_direct, &clt_method_stored_inverse,
    &clt_method_matrix, &clt_method_clusters, &clt_method_wavelet, &clt_method_montecarlo, &clt_method_hybrid, NULL};

enum { METHOD_COUNT = sizeof clt_methods / sizeof clt_methods[0] - 1 };

const char *clt_method_name(size_t index) {
  return index < METHOD_COUNT ? clt_methods[index]->name : NULL;
}

const char *clt_method_summary(size_t index) {
  return index < METHOD_COUNT ? clt_methods[index]->summary : NULL;
}

bool clt_method_invests(size_t index) {
  return index < METHOD_COUNT && clt_methods[index]->invests;
}

const clt_method *clt_method_find(const char *name) {
  for (size_t i = 0; i < METHOD_COUNT; i++) {
    if (strcmp(clt_methods[i]->name, name) == 0) {
      return clt_methods[i];
    }
  }
  return NULL;
}
