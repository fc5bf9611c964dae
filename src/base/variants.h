/* Kernels that come in variants for what a processor has. */
#ifndef CLT_BASE_VARIANTS_H
#define CLT_BASE_VARIANTS_H

#include <stddef.h>

/* Defines name(): the first of the variants that runs here. The last before NULL runs everywhere. */
#define CLT_CHOOSE(name, type, variants)                                                                               \
  const type *name(void) {                                                                                             \
    size_t k = 0;                                                                                                      \
    while (!variants[k]->runs_here()) {                                                                                \
      k++;                                                                                                             \
    }                                                                                                                  \
    return variants[k];                                                                                                \
  }

#endif
