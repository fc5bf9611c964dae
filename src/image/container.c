/* Whether a PNG or JPEG file is whole. */
#include <stdint.h>
#include <string.h>
#include <zlib.h>

#include "image/format.h"

static uint32_t big_endian(const unsigned char *bytes) {
  return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

static clt_status fail_kind(const char *path, const char *kind, clt_error *error) {
  return clt_fail(error, CLT_BAD_INPUT, "%s: is no %s picture; its ending must say what it is", path, kind);
}

static clt_status fail_short(const char *path, const char *kind, clt_error *error) {
  return clt_fail(error, CLT_BAD_INPUT, "%s: the %s picture is cut off; copy or export it again", path, kind);
}

/* A chunk is length, type, content and CRC-32 of type and content (PNG specification, section 5.3). */
enum { SIGNATURE = 8, CHUNK_FRAME = 12, HEADER_CONTENT = 13, COLOUR_TYPE = SIGNATURE + 8 + 9 };

static bool begins_as_png(const clt_bytes *file) {
  static const unsigned char begin[SIGNATURE + 8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n',
                                                     0,    0,   0,   13,  'I',  'H',  'D',  'R'};
  return file->size >= sizeof begin + HEADER_CONTENT && memcmp(file->bytes, begin, sizeof begin) == 0;
}

clt_status clt_png_check(const char *path, clt_bytes *file, bool *grey, clt_error *error) {
  if (!begins_as_png(file)) {
    return fail_kind(path, "PNG", error);
  }
  size_t at = SIGNATURE, kept = SIGNATURE;
  for (bool ended = false; !ended;) {
    unsigned char *chunk = file->bytes + at, *type = chunk + 4;
    if (file->size - at < CHUNK_FRAME || big_endian(chunk) > file->size - at - CHUNK_FRAME) {
      return fail_short(path, "PNG", error);
    }
    size_t content = big_endian(chunk), whole = content + CHUNK_FRAME;
    if (crc32_z(0, type, content + 4) != big_endian(type + 4 + content)) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: the PNG picture is damaged (checksum); copy or export it again", path);
    }
    ended = memcmp(type, "IEND", 4) == 0;
    at += whole;
    if ((type[0] & 0x20) == 0) { /* critical, see section 5.4 */
      memmove(file->bytes + kept, chunk, whole);
      kept += whole;
    }
  }
  file->size = kept;
  *grey = (file->bytes[COLOUR_TYPE] & 3) == 0; /* bit 0 palette, bit 1 colour, bit 2 alpha */
  return CLT_OK;
}

/* Where the next marker is, at or after `at`; size where there is none. 0xff is followed by 0 in entropy-coded data, by
 * d0..d7 at a restart, by another 0xff as filling. */
static size_t next_marker(const clt_bytes *file, size_t at) {
  for (; at + 1 < file->size; at++) {
    unsigned next = file->bytes[at + 1];
    if (file->bytes[at] == 0xff && next != 0 && next != 0xff && !(next >= 0xd0 && next <= 0xd7)) {
      return at;
    }
  }
  return file->size;
}

clt_status clt_jpeg_check(const char *path, const clt_bytes *file, clt_error *error) {
  enum { END_OF_IMAGE = 0xd9 };
  if (file->size < 3 || memcmp(file->bytes, "\xff\xd8\xff", 3) != 0) {
    return fail_kind(path, "JPEG", error);
  }
  size_t at = next_marker(file, 2);
  while (at + 4 <= file->size && file->bytes[at + 1] != END_OF_IMAGE) {
    size_t length = (size_t)file->bytes[at + 2] << 8 | file->bytes[at + 3];
    at = next_marker(file, at + 2 + length);
  }
  bool ended = at + 2 <= file->size && file->bytes[at + 1] == END_OF_IMAGE;
  return ended ? CLT_OK : fail_short(path, "JPEG", error);
}
