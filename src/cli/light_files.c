/* Light as the analysis commands read and write it. */
#include "cli/light_files.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/memory.h"
#include "base/order.h"

size_t cli_grid_values(const cli_grid *grid) {
  return (size_t)grid->channels * (size_t)grid->height * (size_t)grid->width;
}

static clt_status take_values(const clt_image *image, double **values, clt_error *error) {
  size_t count = clt_image_size(image);
  *values = clt_alloc(count, sizeof **values);
  if (*values == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for %zu samples", count);
  }
  for (size_t i = 0; i < count; i++) {
    (*values)[i] = image->data[i];
  }
  return CLT_OK;
}

clt_status cli_drive_values(const char *path, const cli_input *input, double **values, clt_error *error) {
  clt_image drive = {0};
  *values = NULL;
  clt_status status = cli_input_check_drive(input, path, error);
  if (!status) {
    status = cli_drive_read(path, &input->panel, &input->grid, &drive, error);
  }
  if (!status) {
    status = take_values(&drive, values, error);
  }
  clt_image_finish(&drive);
  return status;
}

/* A photograph as radiance. */
static clt_status read_radiance(const char *path, const cli_input *input, double **values, clt_error *error) {
  clt_image photo = {0};
  *values = NULL;
  clt_status status = cli_picture_read(path, NULL, &input->grid, &photo, error);
  if (!status) {
    status = take_values(&photo, values, error);
  }
  size_t cells = cli_grid_values(&input->grid) / (size_t)input->grid.channels;
  for (size_t i = 0; !status && !clt_image_path_is_linear(path) && i < clt_image_size(&photo); i++) {
    (*values)[i] *= input->white[i / cells];
  }
  clt_image_finish(&photo);
  return status;
}

clt_status cli_photo_values(const char *path, const char *black, const cli_input *input, double **values,
                            clt_error *error) {
  double *dark = NULL;
  clt_status status = read_radiance(path, input, values, error);
  if (!status && black) {
    status = read_radiance(black, input, &dark, error);
  }
  size_t count = cli_grid_values(&input->grid), cells = count / (size_t)input->grid.channels;
  for (size_t i = 0; !status && i < count; i++) {
    (*values)[i] -= dark ? dark[i] : (double)clt_transport_black(input->transport, (int)(i / cells))[i % cells];
  }
  free(dark);
  if (status) {
    free(*values);
    *values = NULL;
  }
  return status;
}

clt_status cli_values_image(const double *values, const cli_grid *grid, clt_image *out, clt_error *error) {
  clt_status status = clt_image_init(out, grid->channels, grid->height, grid->width, error);
  for (size_t i = 0; !status && i < clt_image_size(out); i++) {
    out->data[i] = (float)values[i];
  }
  return status;
}

clt_status cli_light_write(const char *folder, const char *name, const double *values, const cli_grid *grid,
                           const double *white, double gain, clt_error *error) {
  static const char *const endings[] = {"exr", "png"};
  double scaled[CLT_CHANNELS_MAX];
  for (int c = 0; c < grid->channels; c++) {
    scaled[c] = white[c] / gain;
  }
  clt_image image = {0};
  clt_status status = cli_values_image(values, grid, &image, error);
  for (int i = 0; !status && i < 2; i++) {
    char file[64], path[CLT_PATH_MAX];
    snprintf(file, sizeof file, "%s.%s", name, endings[i]);
    status = clt_file_join(folder, file, path, error);
    if (!status) {
      status = cli_radiance_write(path, &image, scaled, error);
    }
  }
  clt_image_finish(&image);
  return status;
}

double cli_light_gain(const double *values, const cli_grid *grid, const double *white) {
  size_t count = cli_grid_values(grid), cells = count / (size_t)grid->channels;
  double *sorted = clt_alloc(count, sizeof *sorted), gain = 1;
  for (size_t i = 0; sorted && i < count; i++) {
    sorted[i] = values[i] / white[i / cells];
  }
  if (sorted) {
    clt_sort_doubles(sorted, count);
    double bright = sorted[(size_t)(0.99 * (double)(count - 1))];
    gain = bright > 0 ? exp2(fmin(fmax(floor(-log2(bright)), -8), 20)) : 1;
  }
  free(sorted);
  return gain;
}

clt_status cli_summary_write(const char *folder, const json_t *document, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = clt_file_join(folder, "summary.json", path, error);
  char *text = status ? NULL : json_dumps(document, JSON_INDENT(2));
  if (!status) {
    status = text ? clt_file_write(path, text, strlen(text), error)
                  : clt_fail(error, CLT_FAILED, "%s: the summary could not be put into JSON", path);
  }
  free(text);
  return status;
}
