/* Pictures of the commands: read to a grid, written by their ending. */
#ifndef CLT_CLI_PICTURE_H
#define CLT_CLI_PICTURE_H

#include "counterlight/image.h"
#include "counterlight/panel.h"
#include "counterlight/status.h"

/* What a picture must fit: the cells and channels of a transport or a rig. */
typedef struct cli_grid {
  int width, height, channels;
} cli_grid;

/* Reads a picture to the grid. A .png, .jpg or .exr of any size is resampled and its channels converted; a .npy means
 * its numbers as they are and is refused (CLT_BAD_INPUT, both sizes named) where it does not fit. A .png or
 * .jpg is sRGB, or where a panel is given, the codes that it shows. out is initialised here. */
clt_status cli_picture_read(const char *path, const clt_panel *panel, const cli_grid *grid, clt_image *out,
                            clt_error *error);
/* The same for a drive: values must lie in 0..1. */
clt_status cli_drive_read(const char *path, const clt_panel *panel, const cli_grid *grid, clt_image *out,
                          clt_error *error);

/* CLT_BAD_INPUT where path cannot become a file: its folder is not there or not writable, or it is a folder itself.
 * Asked before any work is done. */
clt_status cli_output_check(const char *path, clt_error *error);
/* The same for a picture, whose ending must be one that clt_image_write knows. */
clt_status cli_picture_output_check(const char *path, clt_error *error);

/* Writes radiance: .exr and .npy as it is, .png and .jpg divided by white (one value a channel) and sRGB-encoded, so
 * that it compares with a target by eye. */
clt_status cli_radiance_write(const char *path, const clt_image *radiance, const double *white, clt_error *error);
/* out = radiance / white, channel by channel; out is initialised here. */
clt_status cli_divide_by_white(const clt_image *radiance, const double *white, clt_image *out, clt_error *error);

#endif
