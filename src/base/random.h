/* Counter-based random numbers (splitmix64; Steele, Lea & Flood, OOPSLA 2014): each is a function of a key and a
 * counter, so that it does not depend on who asks for it in which order. */
#ifndef CLT_BASE_RANDOM_H
#define CLT_BASE_RANDOM_H

#include <stdint.h>

static inline uint64_t clt_random_scramble(uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}
/* A key of its own for each pair. */
static inline uint64_t clt_random_key(uint64_t seed, uint64_t stream) {
  return clt_random_scramble(clt_random_scramble(seed + 0x9e3779b97f4a7c15u) + stream);
}
/* 64 random bits: number `counter` of a key. */
static inline uint64_t clt_random_bits(uint64_t key, uint64_t counter) {
  return clt_random_scramble(key + (counter + 1) * 0x9e3779b97f4a7c15u);
}
/* Uniform in the open interval (0, 1). */
static inline double clt_random_uniform(uint64_t key, uint64_t counter) {
  return ((double)(clt_random_bits(key, counter) >> 12) + 0.5) * 0x1p-52;
}

#endif
