#include "base/memory.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum { LINE = 64, LARGE_PAGE = 1 << 21 };

static void *alloc_aligned(size_t count, size_t size, size_t alignment) {
  if (size != 0 && count > (SIZE_MAX - alignment) / size) {
    return NULL;
  }
  const size_t bytes = (count * size + alignment - 1) / alignment * alignment;
  return aligned_alloc(alignment, bytes > 0 ? bytes : alignment);
}

void *clt_alloc(size_t count, size_t size) {
  void *memory = alloc_aligned(count, size, LINE);
  if (memory != NULL) {
    memset(memory, 0, count * size);
  }
  return memory;
}

void *clt_alloc_large(size_t count, size_t size) {
  enum { PAGES_LEAST = 4 };
  if (size == 0 || count < PAGES_LEAST * (size_t)LARGE_PAGE / size) {
    return clt_alloc(count, size);
  }
  void *memory = alloc_aligned(count, size, LARGE_PAGE);
  if (memory != NULL) {
    madvise(memory, count * size, MADV_HUGEPAGE); /* a wish: without large pages all is as it is */
    memset(memory, 0, count * size);
  }
  return memory;
}
