#include "light.h"

#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

static size_t picture_values(const light_header *header) {
  return (size_t)header->width * header->height * LIGHT_CHANNELS;
}

static bool map(light_ring *ring, const char *path, int fd, size_t bytes) {
  void *at = fd < 0 ? MAP_FAILED : mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (fd >= 0) {
    close(fd);
  }
  if (at == MAP_FAILED) {
    perror(path);
    return false;
  }
  ring->header = at;
  ring->pictures = (float *)((char *)at + sizeof(light_header));
  ring->bytes = bytes;
  return true;
}

bool light_create(light_ring *ring, const char *path, uint32_t width, uint32_t height) {
  light_header empty = {.width = width, .height = height};
  size_t bytes = sizeof empty + LIGHT_SLOTS * picture_values(&empty) * sizeof(float);
  int fd = open(path, O_RDWR | O_CREAT | O_TRUNC, 0600);
  if (fd >= 0 && (ftruncate(fd, (off_t)bytes) != 0 || pwrite(fd, &empty, sizeof empty, 0) != (ssize_t)sizeof empty)) {
    close(fd);
    fd = -1;
  }
  return map(ring, path, fd, bytes);
}

bool light_open(light_ring *ring, const char *path) {
  struct stat found;
  int fd = open(path, O_RDWR);
  if (fd >= 0 && (fstat(fd, &found) != 0 || found.st_size < (off_t)sizeof(light_header))) {
    close(fd);
    fd = -1;
  }
  return map(ring, path, fd, fd >= 0 ? (size_t)found.st_size : 0);
}

void light_close(light_ring *ring) {
  if (ring->header != NULL) {
    munmap(ring->header, ring->bytes);
  }
  *ring = (light_ring){0};
}

static float *slot(const light_ring *ring, unsigned number) {
  return ring->pictures + number % LIGHT_SLOTS * picture_values(ring->header);
}

float *light_next(const light_ring *ring) {
  return slot(ring, atomic_load(&ring->header->written));
}

void light_publish(light_ring *ring, int64_t from_ns) {
  unsigned number = atomic_load(&ring->header->written);
  ring->header->from_ns[number % LIGHT_SLOTS] = from_ns;
  atomic_store(&ring->header->written, number + 1);
}

void light_mean(const light_ring *ring, int64_t from_ns, int64_t to_ns, float *mean) {
  size_t values = picture_values(ring->header);
  unsigned written = atomic_load(&ring->header->written), known = written < LIGHT_SLOTS ? written : LIGHT_SLOTS - 1;
  int64_t end = to_ns;
  memset(mean, 0, values * sizeof *mean);
  for (unsigned back = 1; back <= known && end > from_ns; back++) {
    int64_t since = ring->header->from_ns[(written - back) % LIGHT_SLOTS];
    int64_t start = back == known || since < from_ns ? from_ns : since;
    if (start >= end) {
      continue;
    }
    float share = (float)((double)(end - start) / (double)(to_ns - from_ns));
    const float *picture = slot(ring, written - back);
    for (size_t i = 0; i < values; i++) {
      mean[i] += share * picture[i];
    }
    end = start;
  }
}
