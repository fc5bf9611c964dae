/* Gray code patterns of the panel's columns and rows, each followed by its inverse.
 *
 * Bit b of a column's Gray code x ^ (x >> 1) makes stripes 2^(b+1) pixels wide, and every boundary between two pixels
 * is a stripe edge of exactly one bit. The code has no offset: column 0 is code 0. A picture and its inverse tell lit
 * from dark without a threshold, and their sum, the same for all pairs, tells the light of both and whether the camera
 * holds still; so no white and no black picture is needed. Where the lens resolves less than a pixel, the finest bits
 * fade but keep their zero crossings: the decoder takes the sub-pixel position from these, so that no fringes are
 * added. */
#ifndef CLT_RIG_GEOMETRY_PATTERNS_H
#define CLT_RIG_GEOMETRY_PATTERNS_H

#include <stdbool.h>

#include "counterlight/status.h"

enum { CLT_GRAY_BITS_MAX = 13, CLT_GRAY_PAIRS_MAX = 2 * CLT_GRAY_BITS_MAX };

/* A sequence: columns from the coarsest bit to the finest, then rows; each picture is followed by its inverse. */
typedef struct clt_gray {
  int panel_width, panel_height; /* pixels, each 2..8192 */
  int bits[2];                   /* of a column's and of a row's code: 2^bits reaches the panel's size */
} clt_gray;

/* One picture of the sequence. */
typedef struct clt_gray_picture {
  int axis; /* 0: columns, 1: rows */
  int bit;  /* 0: the finest */
  bool inverse;
} clt_gray_picture;

/* The shortest sequence for a panel. CLT_BAD_INPUT where a side is out of range. */
clt_status clt_gray_init(clt_gray *gray, int panel_width, int panel_height, clt_error *error);
/* The sequence of so many pictures: the shortest one, or both axes with as many bits as fit. CLT_BAD_INPUT where there
 * is none. */
clt_status clt_gray_init_counted(clt_gray *gray, int panel_width, int panel_height, int pictures, clt_error *error);
int clt_gray_pictures(const clt_gray *gray);
clt_gray_picture clt_gray_picture_at(const clt_gray *gray, int index);
/* Number of a bit's pair in the sequence, 0 .. pictures / 2 - 1. */
int clt_gray_pair(const clt_gray *gray, int axis, int bit);
/* Draws picture index as codes 0 and 1, [(c * panel height + y) * panel width + x]. */
void clt_gray_draw(const clt_gray *gray, int index, int channels, float *codes);
/* Whether the bit of a panel coordinate >= 0 is lit in the picture (in its inverse it is dark). */
bool clt_gray_lit(int coordinate, int bit);

#endif
