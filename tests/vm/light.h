/* The light of the room as the camera's pixels see it, from the scene program to the simulated camera, through a shared
 * file: a ring of the latest pictures, each with the time from which it holds. */
#ifndef VM_LIGHT_H
#define VM_LIGHT_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LIGHT_SLOTS = 8, LIGHT_CHANNELS = 3 };

typedef struct light_header {
  uint32_t width, height;       /* camera pixels */
  atomic_uint written;          /* pictures so far: number k stands in slot k % LIGHT_SLOTS */
  int64_t from_ns[LIGHT_SLOTS]; /* CLOCK_MONOTONIC */
} light_header;

typedef struct light_ring {
  light_header *header; /* NULL: not open */
  float *pictures;      /* LIGHT_SLOTS of [(y * width + x) * 3 + c], radiance */
  size_t bytes;
} light_ring;

/* Makes the file for pictures of that size; or opens one that was made. False, with a line on stderr, where it fails.
 */
bool light_create(light_ring *ring, const char *path, uint32_t width, uint32_t height);
bool light_open(light_ring *ring, const char *path);
void light_close(light_ring *ring);

/* Where the next picture is to be written, and its publication: it holds from from_ns on. */
float *light_next(const light_ring *ring);
void light_publish(light_ring *ring, int64_t from_ns);

/* mean[...] of the light between two times; black before the first picture. */
void light_mean(const light_ring *ring, int64_t from_ns, int64_t to_ns, float *mean);

#endif
