#include "base/memory.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

void *clt_alloc(size_t count, size_t size) {
  enum { ALIGNMENT = 64 };
  if (size != 0 && count > (SIZE_MAX - ALIGNMENT) / size) {
    return NULL;
  }
  size_t bytes = (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
  if (bytes == 0) {
    bytes = ALIGNMENT;
  }
  void *memory = aligned_alloc(ALIGNMENT, bytes);
  if (memory != NULL) {
    memset(memory, 0, bytes);
  }
  return memory;
}
