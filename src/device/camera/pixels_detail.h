/* What tells the formats of one decoder apart. */
#ifndef CLT_DEVICE_CAMERA_PIXELS_DETAIL_H
#define CLT_DEVICE_CAMERA_PIXELS_DETAIL_H

#include <stdbool.h>

typedef struct clt_grey_detail {
  int bytes;    /* of a sample */
  bool swapped; /* the high byte first */
} clt_grey_detail;

/* All channels of a pixel in one word. */
typedef struct clt_field_detail {
  int bytes; /* of a pixel */
  bool swapped;
  int shift[3], bits[3]; /* R, G, B or Y, Cb, Cr */
} clt_field_detail;

/* Two pixels in four bytes. */
typedef struct clt_packed_detail {
  int y[2], cb, cr; /* at which byte */
} clt_packed_detail;

/* Brightness in one plane, colour differences after it. */
typedef struct clt_plane_detail {
  int across, down; /* pixels for one pair of colour differences */
  bool interleaved; /* both in one plane */
  bool red_first;
} clt_plane_detail;

/* Where red is in the filter mosaic's square of four; blue is at the opposite corner. */
typedef struct clt_mosaic_detail {
  int x, y;
} clt_mosaic_detail;

#endif
