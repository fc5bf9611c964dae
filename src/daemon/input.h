/* A video input as content: a capture card or a camera of Video4Linux, whose pictures are shown as they come. One that
 * is not there is looked for again and again. */
#ifndef CLT_DAEMON_INPUT_H
#define CLT_DAEMON_INPUT_H

#include <stdbool.h>

#include "image/film.h"

/* True where content of that name is such an input: a node below /dev. */
bool input_is(const char *content);
/* The film of any content: of an input, too, whether it is there or not. CLT_BAD_INPUT as clt_film_open, and where this
 * build knows no inputs. */
clt_status input_film(const char *content, const clt_film_options *options, clt_film **out, clt_error *error);
/* What stands for any content where nothing moves: as clt_film_poster; of an input a grey picture. */
clt_status input_poster(const char *content, clt_image *picture, clt_error *error);

#endif
