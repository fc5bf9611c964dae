/* The calibration file; docs/calibration.md describes it. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/memory.h"
#include "rig/calibration.h"
#include "transport/hdf.h"

static const char format_name[] = "counterlight-calibration";
enum { FORMAT_VERSION = 1, SIDE_MAX = 32768 };

/* Numbers of the root, each within low..high. */
typedef struct number {
  const char *name;
  bool whole;
  double low, high;
  size_t offset; /* in clt_calibration_info: of a double, or an int where whole */
} number;
#define FIELD(name) offsetof(clt_calibration_info, name)
static const number numbers[] = {
    {"panel_width", true, 1, SIDE_MAX, FIELD(panel_width)},
    {"panel_height", true, 1, SIDE_MAX, FIELD(panel_height)},
    {"camera_width", true, 1, SIDE_MAX, FIELD(camera_width)},
    {"camera_height", true, 1, SIDE_MAX, FIELD(camera_height)},
    {"channels", true, 1, CLT_PANEL_CHANNELS, FIELD(channels)},
    {"black_level", false, 0, 65535, FIELD(black_level)},
    {"full_well", false, 1e-3, 1e12, FIELD(full_well)},
    {"read_noise", false, 0, 1e9, FIELD(read_noise)},
    {"latency", false, 0, 60, FIELD(latency_s)},
    {"jitter", false, 0, 60, FIELD(jitter_s)},
    {"complete", false, 0, 60, FIELD(complete_s)},
    {"pitch", false, 1e-6, SIDE_MAX, FIELD(pitch)},
    {"covered", false, 0, 1, FIELD(covered)},
};
enum { NUMBERS = sizeof numbers / sizeof numbers[0] };

static clt_status read_number(const clt_hdf *hdf, const number *n, clt_calibration_info *info, clt_error *error) {
  double found = NAN;
  clt_status status = clt_hdf_read_number(hdf, n->name, &found, error);
  if (status != CLT_OK) {
    return status;
  }
  if (!(found >= n->low && found <= n->high) || (n->whole && found != floor(found))) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the attribute %s is missing or %g; it must be %s%g..%g: calibrate again",
                    hdf->path, n->name, found, n->whole ? "a whole number " : "", n->low, n->high);
  }
  if (n->whole) {
    *(int *)((char *)info + n->offset) = (int)found;
  } else {
    *(double *)((char *)info + n->offset) = found;
  }
  return CLT_OK;
}

static clt_status write_number(const clt_hdf *hdf, const number *n, const clt_calibration_info *info,
                               clt_error *error) {
  return clt_hdf_write_number(hdf, n->name, n->whole ? H5T_NATIVE_INT : H5T_NATIVE_DOUBLE,
                              (const char *)info + n->offset, error);
}

/* An array of doubles of exactly this shape (columns 0: a vector), copied to `to`. */
static clt_status read_doubles(const clt_hdf *hdf, const char *name, size_t rows, size_t columns, double *to,
                               clt_error *error) {
  clt_hdf_array array = {
      .name = name, .type = H5T_NATIVE_DOUBLE, .rank = columns > 0 ? 2 : 1, .shape = {rows, columns}};
  size_t count = rows * (columns > 0 ? columns : 1);
  clt_status status = clt_hdf_read(hdf, &array, error);
  if (status != CLT_OK) {
    return status;
  }
  memcpy(to, array.data, count * sizeof *to);
  free(array.data);
  for (size_t k = 0; k < count; k++) {
    if (!isfinite(to[k])) {
      return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%zu] is %g; calibrate again", hdf->path, name, k, to[k]);
    }
  }
  return CLT_OK;
}

static clt_status write_doubles(const clt_hdf *hdf, const char *name, size_t rows, size_t columns, const double *from,
                                clt_error *error) {
  const clt_hdf_array array = {.name = name,
                               .type = H5T_NATIVE_DOUBLE,
                               .rank = columns > 0 ? 2 : 1,
                               .shape = {rows, columns},
                               .data = (void *)from};
  return clt_hdf_write(hdf, &array, error);
}

/* Every curve of the file is a table of its light at equidistant codes. */
static clt_status curve_of(const clt_hdf *hdf, const char *name, const double *light, clt_curve *curve,
                           clt_error *error) {
  double codes[CLT_CURVE_SAMPLES];
  clt_error why = {0};
  for (int k = 0; k < CLT_CURVE_SAMPLES; k++) {
    codes[k] = k / (CLT_CURVE_SAMPLES - 1.0);
  }
  return clt_curve_from_points(codes, light, CLT_CURVE_SAMPLES, curve, &why) == CLT_OK
             ? CLT_OK
             : clt_fail(error, CLT_BAD_INPUT, "%s: %s is no response curve (%s); calibrate again", hdf->path, name,
                        why.message);
}

static void tabulate(const clt_curve *curve, double *light) {
  for (int k = 0; k < CLT_CURVE_SAMPLES; k++) {
    light[k] = clt_curve_decode(curve, k / (CLT_CURVE_SAMPLES - 1.0));
  }
}

static clt_status read_curves(const clt_hdf *hdf, clt_calibration_info *info, clt_error *error) {
  double responses[CLT_PANEL_CHANNELS][CLT_CURVE_SAMPLES], camera[CLT_CURVE_SAMPLES];
  double mixing[CLT_PANEL_CHANNELS * CLT_PANEL_CHANNELS];
  size_t channels = (size_t)info->channels;
  clt_status status = read_doubles(hdf, "/panel/response", channels, CLT_CURVE_SAMPLES, responses[0], error);
  for (size_t c = 0; c < channels && status == CLT_OK; c++) {
    status = curve_of(hdf, "/panel/response", responses[c], &info->panel.response[c], error);
  }
  status = status == CLT_OK ? read_doubles(hdf, "/camera/response", CLT_CURVE_SAMPLES, 0, camera, error) : status;
  status = status == CLT_OK ? curve_of(hdf, "/camera/response", camera, &info->camera, error) : status;
  if (status == CLT_OK && clt_hdf_has(hdf, "/panel/crosstalk")) {
    status = read_doubles(hdf, "/panel/crosstalk", CLT_PANEL_CHANNELS, CLT_PANEL_CHANNELS, mixing, error);
    status = status == CLT_OK ? clt_panel_set_crosstalk(&info->panel, mixing, error) : status;
  }
  return status == CLT_OK ? read_doubles(hdf, "/black", channels, 0, info->black, error) : status;
}

static clt_status write_curves(const clt_hdf *hdf, const clt_calibration_info *info, clt_error *error) {
  double responses[CLT_PANEL_CHANNELS][CLT_CURVE_SAMPLES], camera[CLT_CURVE_SAMPLES];
  size_t channels = (size_t)info->channels;
  for (size_t c = 0; c < channels; c++) {
    tabulate(&info->panel.response[c], responses[c]);
  }
  tabulate(&info->camera, camera);
  clt_status status = clt_hdf_make_group(hdf, "/panel", error);
  status = status == CLT_OK ? clt_hdf_make_group(hdf, "/camera", error) : status;
  status = status == CLT_OK ? write_doubles(hdf, "/panel/response", channels, CLT_CURVE_SAMPLES, responses[0], error)
                            : status;
  status = status == CLT_OK ? write_doubles(hdf, "/camera/response", CLT_CURVE_SAMPLES, 0, camera, error) : status;
  if (status == CLT_OK && info->panel.mixes) {
    status =
        write_doubles(hdf, "/panel/crosstalk", CLT_PANEL_CHANNELS, CLT_PANEL_CHANNELS, info->panel.crosstalk[0], error);
  }
  return status == CLT_OK ? write_doubles(hdf, "/black", channels, 0, info->black, error) : status;
}

/* The nine numbers of the lens, then its reprojection error; a file need not have them. */
enum { LENS_NUMBERS = 9 };
static clt_status read_lens(const clt_hdf *hdf, clt_calibration_info *info, clt_error *error) {
  double values[LENS_NUMBERS + 1] = {0};
  if (!clt_hdf_has(hdf, "/camera/lens")) {
    return CLT_OK;
  }
  clt_status status = read_doubles(hdf, "/camera/lens", LENS_NUMBERS + 1, 0, values, error);
  if (status == CLT_OK && !(values[0] > 0 && values[1] > 0 && values[LENS_NUMBERS] >= 0)) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: /camera/lens has focal lengths %g and %g and a reprojection error of %g; measure it again",
                    hdf->path, values[0], values[1], values[LENS_NUMBERS]);
  }
  memcpy(info->lens, values, sizeof info->lens);
  info->lens_reprojection = values[LENS_NUMBERS];
  return status;
}

static clt_status write_lens(const clt_hdf *hdf, const clt_calibration_info *info, clt_error *error) {
  double values[LENS_NUMBERS + 1];
  if (!(info->lens[0] > 0)) {
    return CLT_OK;
  }
  memcpy(values, info->lens, sizeof info->lens);
  values[LENS_NUMBERS] = info->lens_reprojection;
  return write_doubles(hdf, "/camera/lens", LENS_NUMBERS + 1, 0, values, error);
}

static clt_status read_exposures(const clt_hdf *hdf, clt_calibration_info *info, clt_error *error) {
  clt_hdf_array array = {.name = "/exposures", .type = H5T_NATIVE_DOUBLE, .rank = 1, .shape = {CLT_HDF_ANY}};
  clt_status status = clt_hdf_read(hdf, &array, error);
  if (status != CLT_OK) {
    return status;
  }
  const double *seconds = array.data;
  bool legal = array.shape[0] >= 1 && array.shape[0] <= CLT_EXPOSURES_MAX;
  for (size_t k = 0; legal && k < array.shape[0]; k++) {
    legal = seconds[k] > (k > 0 ? seconds[k - 1] : 0) && seconds[k] <= 60;
    info->exposures_s[k] = seconds[k];
  }
  info->exposure_count = (int)array.shape[0];
  free(array.data);
  return legal ? CLT_OK
               : clt_fail(error, CLT_BAD_INPUT, "%s: /exposures must be 1 to %d ascending times, s; calibrate again",
                          hdf->path, CLT_EXPOSURES_MAX);
}

/* The map's three planes of floats, and its fates. */
static clt_status read_map(const clt_hdf *hdf, clt_calibration *made, clt_error *error) {
  const clt_calibration_info *info = &made->info;
  clt_pixel_map *map = &made->map;
  const struct {
    const char *name;
    hid_t type;
    void **home;
  } planes[] = {{"/map/x", H5T_NATIVE_FLOAT, (void **)&map->x},
                {"/map/y", H5T_NATIVE_FLOAT, (void **)&map->y},
                {"/map/confidence", H5T_NATIVE_FLOAT, (void **)&map->confidence},
                {"/map/fate", H5T_NATIVE_UINT8, (void **)&map->fate}};
  *map = (clt_pixel_map){.width = info->camera_width,
                         .height = info->camera_height,
                         .panel_width = info->panel_width,
                         .panel_height = info->panel_height};
  clt_status status = CLT_OK;
  for (size_t k = 0; k < sizeof planes / sizeof planes[0] && status == CLT_OK; k++) {
    clt_hdf_array array = {
        .name = planes[k].name, .type = planes[k].type, .rank = 2, .shape = {(size_t)map->height, (size_t)map->width}};
    status = clt_hdf_read(hdf, &array, error);
    *planes[k].home = array.data;
  }
  return status;
}

static clt_status write_map(const clt_hdf *hdf, const clt_pixel_map *map, clt_error *error) {
  const struct {
    const char *name;
    hid_t type;
    void *data;
  } planes[] = {{"/map/x", H5T_NATIVE_FLOAT, map->x},
                {"/map/y", H5T_NATIVE_FLOAT, map->y},
                {"/map/confidence", H5T_NATIVE_FLOAT, map->confidence},
                {"/map/fate", H5T_NATIVE_UINT8, map->fate}};
  clt_status status = clt_hdf_make_group(hdf, "/map", error);
  for (size_t k = 0; k < sizeof planes / sizeof planes[0] && status == CLT_OK; k++) {
    const clt_hdf_array array = {.name = planes[k].name,
                                 .type = planes[k].type,
                                 .rank = 2,
                                 .shape = {(size_t)map->height, (size_t)map->width},
                                 .data = planes[k].data};
    status = clt_hdf_write(hdf, &array, error);
  }
  return status;
}

/* A decoded pixel looks at the panel, and has a confidence. */
static clt_status check_map(clt_calibration *made, const char *path, clt_error *error) {
  const clt_pixel_map *map = &made->map;
  size_t pixels = (size_t)map->width * (size_t)map->height;
  made->info.decoded = 0;
  for (size_t i = 0; i < pixels; i++) {
    bool legal = map->fate[i] < CLT_PIXEL_FATES;
    if (map->fate[i] == CLT_PIXEL_DECODED) {
      legal = map->x[i] >= 0 && map->x[i] <= (float)map->panel_width && map->y[i] >= 0 &&
              map->y[i] <= (float)map->panel_height && map->confidence[i] >= 0 && map->confidence[i] <= 1;
      made->info.decoded++;
    }
    if (!legal) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "%s: /map of camera pixel (%zu, %zu) has fate %d at (%g, %g) with confidence %g; calibrate again",
                      path, i % (size_t)map->width, i / (size_t)map->width, map->fate[i], (double)map->x[i],
                      (double)map->y[i], (double)map->confidence[i]);
    }
  }
  return CLT_OK;
}

static clt_status read_head(const clt_hdf *hdf, int64_t *calibrated, clt_error *error) {
  char format[64] = "";
  double version = 0, seconds = 0;
  clt_status status = clt_hdf_read_text(hdf, "format", format, sizeof format, error);
  status = status == CLT_OK ? clt_hdf_read_number(hdf, "version", &version, error) : status;
  if (status == CLT_OK && (strcmp(format, format_name) != 0 || version > FORMAT_VERSION)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the format is \"%s\" version %g, this program reads \"%s\" up to %d",
                    hdf->path, format, version, format_name, FORMAT_VERSION);
  }
  status = status == CLT_OK ? clt_hdf_read_number(hdf, "calibrated", &seconds, error) : status;
  *calibrated = seconds >= 0 && seconds <= 0x1p53 ? (int64_t)seconds : 0;
  return status;
}

static clt_status read_all(const clt_hdf *hdf, clt_calibration *made, clt_error *error) {
  clt_calibration_info *info = &made->info;
  clt_status status = read_head(hdf, &info->calibrated, error);
  for (size_t k = 0; k < NUMBERS && status == CLT_OK; k++) {
    status = read_number(hdf, &numbers[k], info, error);
  }
  status = status == CLT_OK ? clt_hdf_read_text(hdf, "source", info->source, sizeof info->source, error) : status;
  status = status == CLT_OK ? read_curves(hdf, info, error) : status;
  status = status == CLT_OK ? read_exposures(hdf, info, error) : status;
  status = status == CLT_OK ? read_lens(hdf, info, error) : status;
  return status == CLT_OK ? read_map(hdf, made, error) : status;
}

clt_status clt_calibration_load(const char *path, clt_calibration **out, clt_error *error) {
  clt_hdf hdf;
  clt_calibration *made = clt_alloc(1, sizeof *made);
  if (made == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for a calibration", path);
  }
  clt_hdf_session session = clt_hdf_enter();
  clt_status status = clt_hdf_open(path, &hdf, error);
  status = status == CLT_OK ? read_all(&hdf, made, error) : status;
  clt_hdf_close(&hdf);
  clt_hdf_leave(session);
  status = status == CLT_OK ? check_map(made, path, error) : status;
  if (status != CLT_OK) {
    clt_calibration_destroy(made);
    made = NULL;
  }
  *out = made;
  return status;
}

clt_status clt_calibration_date(const char *path, int64_t *calibrated, clt_error *error) {
  clt_hdf hdf;
  clt_hdf_session session = clt_hdf_enter();
  clt_status status = clt_hdf_open(path, &hdf, error);
  status = status == CLT_OK ? read_head(&hdf, calibrated, error) : status;
  clt_hdf_close(&hdf);
  clt_hdf_leave(session);
  return status;
}

static clt_status write_all(const clt_calibration *calibration, const clt_hdf *hdf, clt_error *error) {
  const int version = FORMAT_VERSION;
  const clt_calibration_info *info = &calibration->info;
  clt_status status = clt_hdf_write_text(hdf, "format", format_name, error);
  status = status == CLT_OK ? clt_hdf_write_number(hdf, "version", H5T_NATIVE_INT, &version, error) : status;
  for (size_t k = 0; k < NUMBERS && status == CLT_OK; k++) {
    status = write_number(hdf, &numbers[k], info, error);
  }
  status =
      status == CLT_OK ? clt_hdf_write_number(hdf, "calibrated", H5T_NATIVE_INT64, &info->calibrated, error) : status;
  status = status == CLT_OK ? clt_hdf_write_text(hdf, "source", info->source, error) : status;
  status = status == CLT_OK ? write_curves(hdf, info, error) : status;
  status = status == CLT_OK ? write_lens(hdf, info, error) : status;
  status = status == CLT_OK
               ? write_doubles(hdf, "/exposures", (size_t)info->exposure_count, 0, info->exposures_s, error)
               : status;
  return status == CLT_OK ? write_map(hdf, &calibration->map, error) : status;
}

clt_status clt_calibration_save(const clt_calibration *calibration, const char *path, clt_error *error) {
  char temporary[CLT_PATH_MAX];
  clt_hdf hdf;
  clt_status status = clt_file_begin(path, temporary, error);
  if (status != CLT_OK) {
    return status;
  }
  clt_hdf_session session = clt_hdf_enter();
  status = clt_hdf_create(temporary, path, &hdf, error);
  if (status == CLT_OK) {
    status = clt_hdf_complete(&hdf, write_all(calibration, &hdf, error), error);
  }
  clt_hdf_leave(session);
  if (status != CLT_OK) {
    clt_file_abandon(temporary);
    return status;
  }
  return clt_file_commit(temporary, path, error);
}
