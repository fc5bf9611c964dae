/* Light as the analysis commands read and write it: channels x cells doubles, a folder of pictures. */
#ifndef CLT_CLI_LIGHT_FILES_H
#define CLT_CLI_LIGHT_FILES_H

#include <jansson.h>

#include "cli/transport_input.h"

/* Samples of a grid. */
size_t cli_grid_values(const cli_grid *grid);
/* A drive as doubles, read as cli_drive_read does; freed by free(). */
clt_status cli_drive_values(const char *path, const cli_input *input, double **values, clt_error *error);
/* A photograph as radiance less black: .exr and .npy hold radiance, .png and .jpg radiance / white. black: a photograph
 * of the room under no drive, or NULL for the transport's b0. Freed by free(). */
clt_status cli_photo_values(const char *path, const char *black, const cli_input *input, double **values,
                            clt_error *error);

/* The picture of values; out is initialised here. */
clt_status cli_values_image(const double *values, const cli_grid *grid, clt_image *out, clt_error *error);
/* Writes folder/name.exr (radiance) and folder/name.png (radiance * gain / white). */
clt_status cli_light_write(const char *folder, const char *name, const double *values, const cli_grid *grid,
                           const double *white, double gain, clt_error *error);
/* The power of two, 2^-8..2^20, that brings the values' 99th percentile over white to 0.5..1; 1 where all are 0. */
double cli_light_gain(const double *values, const cli_grid *grid, const double *white);
/* Writes a document into folder/summary.json and leaves it to the caller. */
clt_status cli_summary_write(const char *folder, const json_t *document, clt_error *error);

#endif
