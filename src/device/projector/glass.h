/* The picture on the glass: from panel codes, or from content that is corrected on the way, to the pixels of the window
 * whose GL context (3.3 core) is current. Both go one way: upload, draw. */
#ifndef CLT_DEVICE_PROJECTOR_GLASS_H
#define CLT_DEVICE_PROJECTOR_GLASS_H

#include "counterlight/device.h"
#include "device/projector/upload.h"

typedef struct clt_glass {
  int width, height, bits; /* of the panel */
  GLuint vertices;         /* an empty vertex array, which core profiles insist on */
  GLuint programs[3];      /* for codes, for moving pictures of the panel's size, and of another */
  int program;             /* for what was put last */
  uint32_t seed;
  clt_upload codes;        /* three layers of unsigned codes */
  clt_upload content;      /* sRGB codes */
  clt_upload gain, offset; /* on the grid, channels in R, G, B */
  clt_upload decode;       /* linear light of the 256 sRGB codes */
  clt_upload encode;       /* codes 0..1 of the panel where piece i of light begins (clt_live_tabulate) in R, the step
                            * to the next in G; a row for each channel */
  clt_panel panel;         /* that encode is for */
  bool encode_known;
} clt_glass;

/* Bits of the window's channels: what a code value can have. */
int clt_glass_bits(void);
/* For a panel of width x height pixels and codes of bits (8..16). */
clt_status clt_glass_open(int width, int height, int bits, clt_glass *glass, clt_error *error);
void clt_glass_close(clt_glass *glass); /* also one that did not open */
/* Puts up a picture as clt_projector_driver's present: codes are rounded to the nearest step. */
clt_status clt_glass_put(clt_glass *glass, const float *codes, clt_error *error);
/* The same for a moving picture. */
clt_status clt_glass_put_live(clt_glass *glass, const clt_live_picture *picture, clt_error *error);
/* Draws what was put last onto a window of width x height pixels, stretched where that is not the panel's size. */
void clt_glass_draw(clt_glass *glass, int width, int height);

#endif
