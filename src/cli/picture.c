/* Pictures of the commands: read to a grid, written by their ending. */
#include "cli/picture.h"

#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "base/file.h"

/* A drive that another program computed in float32 may pass its limits by rounding. */
static const double drive_slack = 1e-5;

static bool ends_with(const char *path, const char *ending) {
  size_t length = strlen(path), most = strlen(ending);
  return length > most && strcasecmp(path + length - most, ending) == 0;
}

static bool fits(const clt_image *image, const cli_grid *grid) {
  return image->width == grid->width && image->height == grid->height && image->channels == grid->channels;
}

/* A file's light at its own size. A grey picture of codes is what every channel of the panel shows. */
static clt_status read_light(const char *path, const clt_panel *panel, int channels, clt_image *out, clt_error *error) {
  static const clt_curve as_it_is = {.kind = CLT_CURVE_LINEAR};
  clt_image file = {0}, codes = {0};
  if (panel == NULL || clt_image_path_is_linear(path)) {
    return clt_image_read(path, NULL, out, error);
  }
  clt_status status = clt_image_read(path, &as_it_is, &file, error);
  if (!status) {
    status = clt_image_convert(&file, file.channels < channels ? channels : file.channels, &codes, error);
  }
  if (!status) {
    status = clt_panel_decode(panel, &codes, out, error);
  }
  clt_image_finish(&file);
  clt_image_finish(&codes);
  return status;
}

clt_status cli_picture_read(const char *path, const clt_panel *panel, const cli_grid *grid, clt_image *out,
                            clt_error *error) {
  clt_image file = {0}, resized = {0};
  clt_status status = read_light(path, panel, grid->channels, &file, error);
  if (!status && ends_with(path, ".npy") && !fits(&file, grid)) {
    status = clt_fail(error, CLT_BAD_INPUT,
                      "%s holds %d x %d x %d numbers (channels x height x width) where the grid has %d x %d x %d; a "
                      ".npy must fit exactly, a .png or .exr is resampled",
                      path, file.channels, file.height, file.width, grid->channels, grid->height, grid->width);
  }
  if (!status) {
    status = clt_image_resize(&file, grid->height, grid->width, &resized, error);
  }
  if (!status) {
    status = clt_image_convert(&resized, grid->channels, out, error);
  }
  clt_image_finish(&file);
  clt_image_finish(&resized);
  return status;
}

clt_status cli_drive_read(const char *path, const clt_panel *panel, const cli_grid *grid, clt_image *out,
                          clt_error *error) {
  clt_status status = cli_picture_read(path, panel, grid, out, error);
  if (status) {
    return status;
  }
  size_t count = clt_image_size(out);
  for (size_t i = 0; i < count; i++) {
    double value = out->data[i];
    if (value < -drive_slack || value > 1 + drive_slack) {
      clt_image_finish(out);
      return clt_fail(error, CLT_BAD_INPUT, "%s: a drive lies in 0..1 (linear light), but this one has a value %g",
                      path, value);
    }
    out->data[i] = value < 0 ? 0 : value > 1 ? 1 : (float)value;
  }
  return CLT_OK;
}

clt_status cli_output_check(const char *path, clt_error *error) {
  char temporary[CLT_PATH_MAX];
  struct stat there;
  if (stat(path, &there) == 0 && !S_ISREG(there.st_mode)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be written: it is there and is no regular file", path);
  }
  return clt_file_begin(path, temporary, error);
}

clt_status cli_picture_output_check(const char *path, clt_error *error) {
  bool known =
      clt_image_path_is_linear(path) || ends_with(path, ".png") || ends_with(path, ".jpg") || ends_with(path, ".jpeg");
  if (!known) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be written: the name must end in .png, .jpg, .exr or .npy", path);
  }
  return cli_output_check(path, error);
}

clt_status cli_divide_by_white(const clt_image *radiance, const double *white, clt_image *out, clt_error *error) {
  clt_status status = clt_image_init(out, radiance->channels, radiance->height, radiance->width, error);
  if (status) {
    return status;
  }
  size_t cells = (size_t)radiance->width * (size_t)radiance->height;
  for (int c = 0; c < radiance->channels; c++) {
    for (size_t i = (size_t)c * cells; i < (size_t)(c + 1) * cells; i++) {
      out->data[i] = (float)(radiance->data[i] / white[c]);
    }
  }
  return CLT_OK;
}

clt_status cli_radiance_write(const char *path, const clt_image *radiance, const double *white, clt_error *error) {
  if (clt_image_path_is_linear(path)) {
    return clt_image_write(path, NULL, radiance, error);
  }
  clt_image seen;
  clt_status status = cli_divide_by_white(radiance, white, &seen, error);
  if (!status) {
    status = clt_image_write(path, NULL, &seen, error);
    clt_image_finish(&seen);
  }
  return status;
}
