/* The file formats of pictures: what file.c picks from by a path's ending, and what they share. */
#ifndef CLT_IMAGE_FORMAT_H
#define CLT_IMAGE_FORMAT_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/image.h"

/* A file's content. bytes is malloc'ed and the owner's to free(); size may be 0. */
typedef struct clt_bytes {
  unsigned char *bytes;
  size_t size;
} clt_bytes;

/* Reads a whole regular file. CLT_BAD_INPUT where it is missing, may not be read or is no regular file. On failure file
 * is empty. */
clt_status clt_bytes_load(const char *path, clt_bytes *file, clt_error *error);

/* One way to hold a picture in a file. read gets an empty image and leaves it empty on failure; the caller checks that
 * samples are finite. curve is never NULL; linear formats ignore it. */
typedef struct clt_image_format {
  const char *endings[2]; /* lower case, with the dot; the second may be NULL */
  bool linear;            /* holds linear floats instead of encoded samples */
  clt_status (*read)(const char *path, const clt_curve *curve, clt_image *image, clt_error *error);
  clt_status (*write)(const char *path, const clt_curve *curve, const clt_image *image, clt_error *error);
} clt_image_format;

extern const clt_image_format clt_format_png, clt_format_jpeg, clt_format_exr, clt_format_npy;

/* Refuse (CLT_BAD_INPUT) what is no PNG or JPEG file, and one that is cut off or damaged, before its decoder sees it:
 * the decoders print messages of their own or fill what is missing with grey. The PNG check also removes the chunks
 * that carry no samples from file (colour profiles, texts), which only make the decoder talk, and tells by *grey
 * whether the file holds one channel, alpha aside. */
clt_status clt_png_check(const char *path, clt_bytes *file, bool *grey, clt_error *error);
clt_status clt_jpeg_check(const char *path, const clt_bytes *file, clt_error *error);

#endif
