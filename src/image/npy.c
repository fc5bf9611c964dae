/* The npy format of numpy, versions 1.0 and 2.0 (numpy.lib.format): magic, version, header length, a Python dictionary
 * {'descr': ..., 'fortran_order': ..., 'shape': ...} as text, then the samples. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/memory.h"
#include "image/format.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "samples are copied as the little-endian host holds them");

enum { MAGIC = 6, PREFIX_V1 = 10, PREFIX_V2 = 12, HEADER_MAX = 4096, DIMENSIONS_MAX = 3, SHAPE_MAX = 32768 };
static const char magic[MAGIC + 1] = "\x93NUMPY";

typedef struct npy_header {
  char descr[16];
  bool fortran_order, has_descr, has_order, has_shape;
  int dimensions;
  size_t shape[DIMENSIONS_MAX];
} npy_header;

static void skip_blanks(const char **text) {
  *text += strspn(*text, " \t\n");
}

/* Takes one character, blanks before it aside. */
static bool take(const char **text, char wanted) {
  skip_blanks(text);
  if (**text != wanted) {
    return false;
  }
  (*text)++;
  return true;
}

static bool take_word(const char **text, const char *word) {
  skip_blanks(text);
  size_t length = strlen(word);
  if (strncmp(*text, word, length) != 0) {
    return false;
  }
  *text += length;
  return true;
}

/* A quoted string without escapes; of printable characters only, since messages quote it. */
static bool take_string(const char **text, char *out, size_t size) {
  skip_blanks(text);
  char quote = **text;
  if (quote != '\'' && quote != '"') {
    return false;
  }
  const char *begin = *text + 1, *end = strchr(begin, quote);
  if (end == NULL || (size_t)(end - begin) >= size) {
    return false;
  }
  for (const char *at = begin; at < end; at++) {
    if (*at < ' ' || *at > '~') {
      return false;
    }
  }
  memcpy(out, begin, (size_t)(end - begin));
  out[end - begin] = '\0';
  *text = end + 1;
  return true;
}

/* A tuple of at most DIMENSIONS_MAX counts. */
static bool take_shape(const char **text, npy_header *header) {
  if (!take(text, '(')) {
    return false;
  }
  while (!take(text, ')')) {
    char *end = NULL;
    skip_blanks(text);
    if (**text < '0' || **text > '9' || header->dimensions == DIMENSIONS_MAX) {
      return false;
    }
    header->shape[header->dimensions++] = strtoull(*text, &end, 10);
    *text = end;
    if (!take(text, ',') && **text != ')') {
      return false;
    }
  }
  return true;
}

static bool take_value(const char **text, const char *key, npy_header *header) {
  if (strcmp(key, "descr") == 0 && !header->has_descr) {
    header->has_descr = true;
    return take_string(text, header->descr, sizeof header->descr);
  }
  if (strcmp(key, "fortran_order") == 0 && !header->has_order) {
    header->has_order = true;
    header->fortran_order = take_word(text, "True");
    return header->fortran_order || take_word(text, "False");
  }
  if (strcmp(key, "shape") == 0 && !header->has_shape) {
    header->has_shape = true;
    return take_shape(text, header);
  }
  return false;
}

static bool parse_header(const char *text, npy_header *header) {
  if (!take(&text, '{')) {
    return false;
  }
  while (!take(&text, '}')) {
    char key[16];
    if (!take_string(&text, key, sizeof key) || !take(&text, ':') || !take_value(&text, key, header)) {
      return false;
    }
    if (!take(&text, ',') && *text != '}') {
      return false;
    }
  }
  skip_blanks(&text);
  return *text == '\0' && header->has_descr && header->has_order && header->has_shape;
}

/* Fills header and where the samples begin. */
static clt_status read_header(const char *path, const clt_bytes *file, npy_header *header, size_t *begin,
                              clt_error *error) {
  const unsigned char *bytes = file->bytes;
  if (file->size < PREFIX_V2 || memcmp(bytes, magic, MAGIC) != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is no npy file; write it with numpy.save", path);
  }
  if ((bytes[6] != 1 && bytes[6] != 2) || bytes[7] != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: npy version %d.%d is not read; write 1.0 or 2.0", path, bytes[6],
                    bytes[7]);
  }
  size_t prefix = bytes[6] == 1 ? PREFIX_V1 : PREFIX_V2, length = (size_t)bytes[8] | (size_t)bytes[9] << 8;
  if (bytes[6] == 2) {
    length |= (size_t)bytes[10] << 16 | (size_t)bytes[11] << 24;
  }
  char text[HEADER_MAX + 1] = "";
  if (length > HEADER_MAX || length > file->size - prefix) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the npy header is cut off or longer than %d bytes", path, HEADER_MAX);
  }
  memcpy(text, bytes + prefix, length);
  if (strlen(text) != length || !parse_header(text, header)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: the npy header is not understood; write one float array of 2 or 3 "
                    "dimensions with numpy.save",
                    path);
  }
  *begin = prefix + length;
  return CLT_OK;
}

/* What the header may say: float32 or float64, row-major, [channels, height, width] or [height, width]. */
static clt_status check_header(const char *path, npy_header *header, clt_error *error) {
  if (strcmp(header->descr, "<f4") != 0 && strcmp(header->descr, "<f8") != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: samples are of type '%s'; save float32 or float64, little endian", path,
                    header->descr);
  }
  if (header->fortran_order) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the array is in Fortran order; save numpy.ascontiguousarray of it",
                    path);
  }
  if (header->dimensions < 2) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: has %d dimensions; save [channels, height, width] or [height, width]",
                    path, header->dimensions);
  }
  if (header->dimensions == 2) {
    memmove(header->shape + 1, header->shape, 2 * sizeof header->shape[0]);
    header->shape[0] = 1;
  }
  for (int d = 0; d < DIMENSIONS_MAX; d++) {
    if (header->shape[d] > SHAPE_MAX) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: a dimension of %zu is over the limit of %d", path, header->shape[d],
                      SHAPE_MAX);
    }
  }
  return CLT_OK;
}

static clt_status take_samples(const char *path, const clt_bytes *file, size_t begin, const npy_header *header,
                               clt_image *image, clt_error *error) {
  size_t item = header->descr[2] == '4' ? sizeof(float) : sizeof(double);
  size_t size = header->shape[0] * header->shape[1] * header->shape[2]; /* <= 2^45 */
  if (file->size - begin != size * item) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: holds %zu bytes of samples where its shape needs %zu; save it again",
                    path, file->size - begin, size * item);
  }
  clt_status status = clt_image_init(image, (int)header->shape[0], (int)header->shape[1], (int)header->shape[2], error);
  if (status != CLT_OK) {
    return clt_fail_within(error, "%s: ", path);
  }
  const unsigned char *from = file->bytes + begin;
  if (item == sizeof(float)) {
    memcpy(image->data, from, size * item);
    return CLT_OK;
  }
  for (size_t i = 0; i < size; i++) {
    double sample;
    memcpy(&sample, from + i * item, item);
    image->data[i] = (float)sample;
  }
  return CLT_OK;
}

static clt_status read_npy(const char *path, const clt_curve *curve, clt_image *image, clt_error *error) {
  (void)curve;
  clt_bytes file;
  npy_header header = {0};
  size_t begin = 0;
  clt_status status = clt_bytes_load(path, &file, error);
  if (status == CLT_OK) {
    status = read_header(path, &file, &header, &begin, error);
  }
  if (status == CLT_OK) {
    status = check_header(path, &header, error);
  }
  if (status == CLT_OK) {
    status = take_samples(path, &file, begin, &header, image, error);
  }
  free(file.bytes);
  return status;
}

/* The header is padded with blanks so that the samples begin at a multiple of 64 bytes, as numpy does. */
static clt_status write_npy(const char *path, const clt_curve *curve, const clt_image *image, clt_error *error) {
  (void)curve;
  enum { BEGIN = 128 };
  size_t samples = clt_image_size(image) * sizeof(float);
  char *bytes = clt_alloc(BEGIN + samples, 1);
  if (bytes == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: memory is short for %zu bytes", path, samples);
  }
  memset(bytes, ' ', BEGIN);
  memcpy(bytes, magic, MAGIC);
  memcpy(bytes + MAGIC, (const unsigned char[]){1, 0, BEGIN - PREFIX_V1, 0}, PREFIX_V1 - MAGIC);
  int used = snprintf(bytes + PREFIX_V1, BEGIN - PREFIX_V1,
                      "{'descr': '<f4', 'fortran_order': False, 'shape': (%d, %d, %d), }", image->channels,
                      image->height, image->width);
  bytes[PREFIX_V1 + used] = ' '; /* snprintf's terminator */
  bytes[BEGIN - 1] = '\n';
  memcpy(bytes + BEGIN, image->data, samples);
  clt_status status = clt_file_write(path, bytes, BEGIN + samples, error);
  free(bytes);
  return status;
}

const clt_image_format clt_format_npy = {{".npy", NULL}, true, read_npy, write_npy};
