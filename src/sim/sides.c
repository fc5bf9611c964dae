#include "sim/sides.h"

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/memory.h"

enum { WORD = 64 };

/* words[(2 * piece + side) * per_side + surface / WORD], bit surface % WORD: the piece reaches to that side of the
 * surface's plane; side 0 is the front. */
struct clt_sides {
  uint64_t *words;
  size_t per_side;
};

static const uint64_t *words_of(const clt_sides *sides, int piece, int side) {
  return &sides->words[(2 * (size_t)piece + (size_t)side) * sides->per_side];
}

static void find(clt_sides *sides, const clt_rectangle *surfaces, int surface_count, const clt_rectangle *pieces,
                 int piece_count) {
#pragma omp parallel for schedule(static)
  for (int piece = 0; piece < piece_count; piece++) {
    uint64_t *words = &sides->words[2 * (size_t)piece * sides->per_side];
    for (int k = 0; k < surface_count; k++) {
      unsigned found = (unsigned)clt_rectangle_sides(&surfaces[k], &pieces[piece]);
      words[k / WORD] |= (uint64_t)(found & 1) << k % WORD;
      words[sides->per_side + (size_t)(k / WORD)] |= (uint64_t)(found >> 1) << k % WORD;
    }
  }
}

clt_status clt_sides_create(const clt_rectangle *surfaces, int surface_count, const clt_rectangle *pieces,
                            int piece_count, clt_sides **out, clt_error *error) {
  clt_sides *sides = clt_alloc(1, sizeof *sides);
  if (sides != NULL) {
    sides->per_side = ((size_t)surface_count + WORD - 1) / WORD;
    sides->words = clt_alloc(2 * (size_t)piece_count * sides->per_side, sizeof *sides->words);
  }
  if (sides == NULL || sides->words == NULL) {
    clt_sides_destroy(sides);
    return clt_fail(error, CLT_FAILED, "out of memory for what stands between %d surfaces", surface_count);
  }
  find(sides, surfaces, surface_count, pieces, piece_count);
  *out = sides;
  return CLT_OK;
}

void clt_sides_destroy(clt_sides *sides) {
  if (sides != NULL) {
    free(sides->words);
    free(sides);
  }
}

bool clt_sides_in_front(const clt_sides *sides, int piece, int surface) {
  return (words_of(sides, piece, 0)[surface / WORD] >> surface % WORD & 1) != 0;
}

bool clt_sides_may_be_parted(const clt_sides *sides, int i, int j, int a, int b) {
  const uint64_t *front_i = words_of(sides, i, 0), *front_j = words_of(sides, j, 0);
  const uint64_t *back_i = words_of(sides, i, 1), *back_j = words_of(sides, j, 1);
  for (size_t k = 0; k < sides->per_side; k++) {
    uint64_t both = (front_i[k] | front_j[k]) & (back_i[k] | back_j[k]);
    both &= (size_t)a / WORD == k ? ~((uint64_t)1 << a % WORD) : ~(uint64_t)0;
    both &= (size_t)b / WORD == k ? ~((uint64_t)1 << b % WORD) : ~(uint64_t)0;
    if (both != 0) {
      return true;
    }
  }
  return false;
}
