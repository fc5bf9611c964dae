/* Aligned memory. */
#ifndef CLT_BASE_MEMORY_H
#define CLT_BASE_MEMORY_H

#include <stddef.h>

/* count * size zeroed bytes, 64-byte aligned; NULL where that overflows or memory is short. Freed by free(). */
void *clt_alloc(size_t count, size_t size);
/* The same, in pages of 2 MB where it is some of them and the system has them: for planes of cells that are passed over
 * leaf by leaf, where each row of a leaf lies in a page of its own. */
void *clt_alloc_large(size_t count, size_t size);

#endif
