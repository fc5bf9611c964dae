/* What stands on the simulated projector's glass while a film plays: linked into a daemon, it writes the strip that
 * says which frame it is (tests/image/make_film.cpp) of every moving picture, in panel codes, with the daemon's time.
 */
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "counterlight/device.h"
#include "counterlight/frames.h"
#include "image/film.h"

enum { BLOCKS = 36 };

typedef struct record {
  int64_t shown_ns;
  uint8_t codes[BLOCKS];
} record;

/* The file of $CLT_GLASS, which is "WIDTH HEIGHT FILE" of the panel. */
static int open_glass(int *width, int *height) {
  char path[4096];
  const char *where = getenv("CLT_GLASS");
  bool known = where != NULL && sscanf(where, "%d %d %4095s", width, height, path) == 3;
  return known ? open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600) : -1;
}

/* Without codes: the film begins now. */
static void write_strip(const float *codes) {
  static int file = -1, width, height;
  file = file < 0 ? open_glass(&width, &height) : file;
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  record strip;
  memset(&strip, 0, sizeof strip);
  strip.shown_ns = (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
  for (int block = 0; block < BLOCKS && codes != NULL; block++) {
    int y = (2 * block + 1) * height / (2 * BLOCKS);
    strip.codes[block] = (uint8_t)(255 * codes[(size_t)y * (size_t)width + (size_t)width / 32]);
  }
  if (write(file, &strip, sizeof strip) != (ssize_t)sizeof strip) {
    abort();
  }
}

void __real_clt_live_dither(float *codes, size_t count, int bits, uint32_t seed);
void __wrap_clt_live_dither(float *codes, size_t count, int bits, uint32_t seed);

clt_status __real_clt_film_next(clt_film *film, uint8_t *codes, clt_film_frame *frame, clt_error *error);
clt_status __wrap_clt_film_next(clt_film *film, uint8_t *codes, clt_film_frame *frame, clt_error *error);

/* The last that the simulated projector does to a moving picture; the linker has the names from --wrap. */
void __wrap_clt_live_dither(float *codes, size_t count, int bits, uint32_t seed) {
  __real_clt_live_dither(codes, count, bits, seed);
  write_strip(codes);
}

clt_status __real_clt_frames_next(clt_frames *frames, const uint8_t *content, int width, int height, double seconds,
                                  float *gain, float *offset, clt_frames_result *result, clt_error *error);
clt_status __wrap_clt_frames_next(clt_frames *frames, const uint8_t *content, int width, int height, double seconds,
                                  float *gain, float *offset, clt_frames_result *result, clt_error *error);

/* Now and then a frame takes $CLT_HICCUP_MS longer. */
clt_status __wrap_clt_frames_next(clt_frames *frames, const uint8_t *content, int width, int height, double seconds,
                                  float *gain, float *offset, clt_frames_result *result, clt_error *error) {
  enum { BETWEEN = 16 };
  static int count;
  const char *longer = getenv("CLT_HICCUP_MS");
  if (longer != NULL && ++count % BETWEEN == 0) {
    nanosleep(&(struct timespec){0, 1000000 * atol(longer)}, NULL);
  }
  return __real_clt_frames_next(frames, content, width, height, seconds, gain, offset, result, error);
}

/* The player's first frame is due when it is decoded. */
clt_status __wrap_clt_film_next(clt_film *film, uint8_t *codes, clt_film_frame *frame, clt_error *error) {
  static bool begun;
  clt_status status = __real_clt_film_next(film, codes, frame, error);
  if (!begun) {
    begun = true;
    write_strip(NULL);
  }
  return status;
}
