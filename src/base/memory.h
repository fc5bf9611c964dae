/* Aligned memory. */
#ifndef CLT_BASE_MEMORY_H
#define CLT_BASE_MEMORY_H

#include <stddef.h>

/* count * size zeroed bytes, 64-byte aligned; NULL where that overflows or memory is short. Freed by free(). */
void *clt_alloc(size_t count, size_t size);

#endif
