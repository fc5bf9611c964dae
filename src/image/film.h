/* Films: content that changes, as 8-bit sRGB pictures with the time that each is shown. Kinds stand in one table: a
 * picture, a folder of pictures (in the order of their names), a video file. The last two begin again at their end. And
 * one that a device delivers, which has no end. */
#ifndef CLT_IMAGE_FILM_H
#define CLT_IMAGE_FILM_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/image.h"
#include "counterlight/status.h"

typedef struct clt_film clt_film;

typedef struct clt_film_options {
  int width, height; /* of the panel: pictures are cropped to its aspect, and made smaller where they have more */
  double picture_s;  /* that each picture of a folder is shown, > 0 */
} clt_film_options;

/* What is shown: codes[(y * width + x) * 3 + c] for `seconds` (infinite for a picture; 0: until the next one comes). */
typedef struct clt_film_frame {
  int width, height;
  double seconds;
} clt_film_frame;

/* True where the path is a folder, or a file whose ending is not that of a picture. */
bool clt_film_moves(const char *path);

/* CLT_BAD_INPUT where there is nothing to show, or it is of no kind that is known. */
clt_status clt_film_open(const char *path, const clt_film_options *options, clt_film **out, clt_error *error);
/* Where pictures come from as they are taken. next() waits for one, of whole width x height codes as above, which stay
 * the source's until its next call; sizes may change. What fails is tried again at the next call. */
typedef struct clt_film_source {
  void *self;
  clt_status (*next)(void *self, const uint8_t **codes, int *width, int *height, clt_error *error);
  void (*close)(void *self);
} clt_film_source;
/* Takes the source over, on failure as well. */
clt_status clt_film_of_source(const clt_film_source *source, const clt_film_options *options, clt_film **out,
                              clt_error *error);
void clt_film_close(clt_film *film); /* accepts NULL */
/* The most bytes that codes of a frame take. */
size_t clt_film_bytes(const clt_film *film);
/* The next frame. What cannot be decoded is left out; an error where a whole round gave nothing. */
clt_status clt_film_next(clt_film *film, uint8_t *codes, clt_film_frame *frame, clt_error *error);
/* The first frame of a path at its own size, in linear light, for what shows no moving pictures. */
clt_status clt_film_poster(const char *path, clt_image *picture, clt_error *error);

#endif
