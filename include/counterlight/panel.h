/* Panels: from the light that a drive asks for to the code values that a projector shows.
 *
 * Light of channel c = sum over k of crosstalk[c][k] * response[k](code of k). The rows of crosstalk sum to 1, so that
 * a white drive is the white panel. */
#ifndef COUNTERLIGHT_PANEL_H
#define COUNTERLIGHT_PANEL_H

#include <stdbool.h>

#include "counterlight/image.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { CLT_PANEL_CHANNELS = 3 };

/* A zeroed one is a linear panel whose channels do not mix. */
typedef struct clt_panel {
  clt_curve response[CLT_PANEL_CHANNELS]; /* of each channel, code value to light */
  bool mixes;                             /* the matrices hold; set by clt_panel_set_crosstalk */
  double crosstalk[CLT_PANEL_CHANNELS][CLT_PANEL_CHANNELS];
  double unmix[CLT_PANEL_CHANNELS][CLT_PANEL_CHANNELS]; /* its inverse */
} clt_panel;

/* The panel whose channels all have one response and do not mix. */
CLT_PUBLIC clt_panel clt_panel_of_curve(const clt_curve *response);
/* Takes light[3 c + k], the light of channel c by the full code of channel k alone, in any unit per row c, as the
 * panel's crosstalk. CLT_BAD_INPUT where a row is dark or the matrix has no safe inverse: channels that look alike. */
CLT_PUBLIC clt_status clt_panel_set_crosstalk(clt_panel *panel, const double light[9], clt_error *error);

/* Codes for a drive (linear light, 0..1; 1 or 3 channels) on a panel of `channels` x height x width pixels, codes[(c *
 * height + y) * width + x]. A cell's light covers the pixels that lie in it; a drive of one channel is repeated for
 * every channel. Light that no code of a channel gives, below 0 or above 1 after the crosstalk is undone, is clipped.
 */
CLT_PUBLIC void clt_panel_encode(const clt_panel *panel, const clt_image *drive, int channels, int height, int width,
                                 float *codes);
/* The light that a panel sends out for codes (0..1, clipped; 1 or 3 channels, as many as the panel has): what
 * clt_panel_encode undoes. light is initialised here. */
CLT_PUBLIC clt_status clt_panel_decode(const clt_panel *panel, const clt_image *codes, clt_image *light,
                                       clt_error *error);
/* The light that a panel shows for a drive (as for clt_panel_encode, a panel of as many channels): of its codes,
 * rounded to `bits` (1..16). shown is initialised here, of the drive's size. */
CLT_PUBLIC clt_status clt_panel_shown(const clt_panel *panel, int bits, const clt_image *drive, clt_image *shown,
                                      clt_error *error);
/* Writes a drive: .png and .jpg hold the codes that show it (8 bit), .exr and .npy its linear light. As
 * clt_image_write. */
CLT_PUBLIC clt_status clt_panel_write(const char *path, const clt_panel *panel, const clt_image *drive,
                                      clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
