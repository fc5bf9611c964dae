/* The transport file; docs/transport-file.md describes it. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "transport/check.h"
#include "transport/kind.h"

static const char format_name[] = "counterlight-transport";
enum { FORMAT_VERSION = 1 };

/* A whole number that the file must give. */
static clt_status read_size(const clt_hdf *hdf, const char *name, int low, int high, int *value, clt_error *error) {
  double found = NAN;
  clt_status status = clt_hdf_read_number(hdf, name, &found, error);
  if (status != CLT_OK) {
    return status;
  }
  if (isnan(found)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the attribute %s is missing; write it as an integer", hdf->path, name);
  }
  if (!(found >= low && found <= high) || found != floor(found)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the attribute %s is %.10g; it must be a whole number %d..%d", hdf->path,
                    name, found, low, high);
  }
  *value = (int)found;
  return CLT_OK;
}

static clt_status read_format(const clt_hdf *hdf, clt_error *error) {
  char format[64] = "";
  clt_status status = clt_hdf_read_text(hdf, "format", format, sizeof format, error);
  if (status != CLT_OK) {
    return status;
  }
  if (strcmp(format, format_name) != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the attribute format is \"%s\", not \"%s\": this is no transport file",
                    hdf->path, format, format_name);
  }
  int version;
  status = read_size(hdf, "version", 1, 1 << 30, &version, error);
  if (status == CLT_OK && version > FORMAT_VERSION) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: has version %d of the format, this program reads up to %d; use a newer counterlight",
                    hdf->path, version, FORMAT_VERSION);
  }
  return status;
}

static const struct {
  const char *name;
  size_t offset; /* of a char[CLT_TEXT_MAX] */
} provenance_texts[] = {{"scheme", offsetof(clt_provenance, scheme)},
                        {"plan", offsetof(clt_provenance, plan)},
                        {"source", offsetof(clt_provenance, source)},
                        {"response", offsetof(clt_provenance, response)}};
enum { PROVENANCE_TEXTS = sizeof provenance_texts / sizeof provenance_texts[0] };

/* A whole number, 0 where it does not fit (or is no number). */
static int64_t whole(double value, double most) {
  return value >= -most && value <= most ? (int64_t)value : 0;
}

static clt_status read_provenance(const clt_hdf *hdf, clt_provenance *provenance, clt_error *error) {
  double acquired = 0, patterns = 0, frames = 0, seconds = 0, deviation = -1;
  const struct {
    const char *name;
    double *value;
  } numbers[] = {{"acquired", &acquired},
                 {"patterns", &patterns},
                 {"frames", &frames},
                 {"seconds", &seconds},
                 {"error", &deviation}};
  clt_status status = CLT_OK;
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0] && status == CLT_OK; i++) {
    status = clt_hdf_read_number(hdf, numbers[i].name, numbers[i].value, error);
  }
  for (size_t i = 0; i < PROVENANCE_TEXTS && status == CLT_OK; i++) {
    status = clt_hdf_read_text(hdf, provenance_texts[i].name, (char *)provenance + provenance_texts[i].offset,
                               CLT_TEXT_MAX, error);
  }
  provenance->acquired = whole(acquired, 0x1p53);
  provenance->patterns = (int)whole(patterns, INT32_MAX);
  provenance->frames = (int)whole(frames, INT32_MAX);
  provenance->seconds = isfinite(seconds) ? seconds : 0;
  provenance->error = isfinite(deviation) ? deviation : -1;
  return status;
}

static clt_status write_provenance(const clt_hdf *hdf, const clt_provenance *provenance, clt_error *error) {
  const struct {
    const char *name;
    hid_t type;
    const void *value;
  } numbers[] = {{"acquired", H5T_NATIVE_INT64, &provenance->acquired},
                 {"patterns", H5T_NATIVE_INT, &provenance->patterns},
                 {"frames", H5T_NATIVE_INT, &provenance->frames},
                 {"seconds", H5T_NATIVE_DOUBLE, &provenance->seconds},
                 {"error", H5T_NATIVE_DOUBLE, &provenance->error}};
  clt_status status = CLT_OK;
  for (size_t i = 0; i < sizeof numbers / sizeof numbers[0] && status == CLT_OK; i++) {
    status = clt_hdf_write_number(hdf, numbers[i].name, numbers[i].type, numbers[i].value, error);
  }
  for (size_t i = 0; i < PROVENANCE_TEXTS && status == CLT_OK; i++) {
    char text[CLT_TEXT_MAX];
    snprintf(text, sizeof text, "%s", (const char *)provenance + provenance_texts[i].offset);
    status = clt_hdf_write_text(hdf, provenance_texts[i].name, text, error);
  }
  return status;
}

/* What a file may hold for every observed cell, channels x rows. */
static const struct plane {
  const char *name;
  size_t offset; /* of the float * in a clt_transport */
  clt_status (*check)(const clt_values *values, clt_error *error);
} planes[] = {{"/black", offsetof(clt_transport, black), clt_check_finite},
              {"/flood", offsetof(clt_transport, flood), clt_check_finite},
              {"/sigma", offsetof(clt_transport, sigma), clt_check_deviations}};
enum { PLANES = sizeof planes / sizeof planes[0] };

static float **plane_values(const clt_transport *transport, const struct plane *plane) {
  return (float **)((char *)transport + plane->offset);
}

static clt_hdf_array plane_array(const clt_transport *transport, const struct plane *plane) {
  return (clt_hdf_array){.name = plane->name,
                         .type = H5T_NATIVE_FLOAT,
                         .rank = 2,
                         .shape = {(size_t)transport->channels, transport->rows},
                         .data = *plane_values(transport, plane)};
}

static clt_status read_planes(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  for (int i = 0; i < PLANES; i++) {
    clt_hdf_array array = plane_array(transport, &planes[i]);
    if (!clt_hdf_has_values(hdf, planes[i].name)) {
      continue;
    }
    clt_status status = clt_hdf_read(hdf, &array, error);
    if (status != CLT_OK) {
      return status;
    }
    free(*plane_values(transport, &planes[i]));
    *plane_values(transport, &planes[i]) = array.data;
  }
  return CLT_OK;
}

static clt_status write_planes(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_status status = CLT_OK;
  for (int i = 0; i < PLANES && status == CLT_OK; i++) {
    clt_hdf_array array = plane_array(transport, &planes[i]);
    status = array.data == NULL ? CLT_OK : clt_hdf_write(hdf, &array, error);
  }
  return status;
}

/* All that a transport's values must be, whether they come from a file or go into one. */
static clt_status check_values(const clt_transport *transport, const char *source, clt_error *error) {
  clt_status status = transport->kind->check(transport, source, error);
  for (int i = 0; i < PLANES && status == CLT_OK; i++) {
    clt_values values = {.source = source,
                         .name = planes[i].name,
                         .rank = 2,
                         .shape = {(size_t)transport->channels, transport->rows},
                         .data = *plane_values(transport, &planes[i])};
    status = values.data == NULL ? CLT_OK : planes[i].check(&values, error);
  }
  return status;
}

/* The kind whose dataset or group the file holds. */
static clt_status find_kind(const clt_hdf *hdf, const clt_kind **kind, clt_error *error) {
  char names[128] = "";
  for (size_t i = 0; clt_kinds[i] != NULL; i++) {
    char name[32];
    snprintf(name, sizeof name, "/%s", clt_kinds[i]->name);
    if (clt_hdf_has(hdf, name)) {
      *kind = clt_kinds[i];
      return CLT_OK;
    }
    size_t used = strlen(names);
    snprintf(names + used, sizeof names - used, "%s%s", i == 0 ? "" : " nor ", name);
  }
  return clt_fail(error, CLT_BAD_INPUT, "%s: holds no transport, neither %s; write /dense [channels, rows, N]",
                  hdf->path, names);
}

/* What is read before an error is still in *out. */
static clt_status read_transport(const clt_hdf *hdf, clt_transport **out, clt_error *error) {
  const clt_kind *kind = NULL;
  int width = 0, height = 0, channels = 0;
  const struct {
    const char *name;
    int most, *value;
  } sizes[] = {{"width", CLT_GRID_SIDE_MAX, &width},
               {"height", CLT_GRID_SIDE_MAX, &height},
               {"channels", CLT_CHANNELS_MAX, &channels}};
  clt_status status = read_format(hdf, error);
  for (size_t i = 0; i < sizeof sizes / sizeof sizes[0] && status == CLT_OK; i++) {
    status = read_size(hdf, sizes[i].name, 1, sizes[i].most, sizes[i].value, error);
  }
  if (status == CLT_OK) {
    status = find_kind(hdf, &kind, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_begin(kind, width, height, channels, hdf->path, out, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  clt_transport *transport = *out;
  status = kind->load(transport, hdf, error);
  if (status == CLT_OK) {
    status = clt_transport_keep_black(transport, error);
  }
  if (status == CLT_OK) {
    status = read_planes(transport, hdf, error);
  }
  if (status == CLT_OK) {
    status = read_provenance(hdf, &transport->provenance, error);
  }
  return status;
}

clt_status clt_transport_load(const char *path, clt_transport **out, clt_error *error) {
  clt_hdf hdf;
  clt_transport *transport = NULL; /* also what is there of it after a failure */
  clt_hdf_session session = clt_hdf_enter();
  clt_status status = clt_hdf_open(path, &hdf, error);
  if (status == CLT_OK) {
    status = read_transport(&hdf, &transport, error);
  }
  clt_hdf_close(&hdf);
  clt_hdf_leave(session);
  if (status == CLT_OK) {
    status = check_values(transport, path, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    transport = NULL;
  }
  *out = transport;
  return status;
}

static clt_status write_root(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  const int version = FORMAT_VERSION;
  const struct {
    const char *name;
    const int *value;
  } sizes[] = {{"version", &version},
               {"width", &transport->width},
               {"height", &transport->height},
               {"channels", &transport->channels}};
  clt_status status = clt_hdf_write_text(hdf, "format", format_name, error);
  for (size_t i = 0; i < sizeof sizes / sizeof sizes[0] && status == CLT_OK; i++) {
    status = clt_hdf_write_number(hdf, sizes[i].name, H5T_NATIVE_INT, sizes[i].value, error);
  }
  return status == CLT_OK ? clt_hdf_write_text(hdf, "storage", transport->kind->name, error) : status;
}

static clt_status write_transport(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_status status = write_root(transport, hdf, error);
  if (status == CLT_OK) {
    status = write_provenance(hdf, &transport->provenance, error);
  }
  if (status == CLT_OK) {
    status = write_planes(transport, hdf, error);
  }
  return status == CLT_OK ? transport->kind->save(transport, hdf, error) : status;
}

clt_status clt_transport_save(const clt_transport *transport, const char *path, clt_error *error) {
  /* A file that loading would refuse must not replace one that it accepts. */
  clt_status status = check_values(transport, path, error);
  char temporary[CLT_PATH_MAX];
  if (status != CLT_OK || (status = clt_file_begin(path, temporary, error)) != CLT_OK) {
    return status;
  }
  clt_hdf hdf;
  clt_hdf_session session = clt_hdf_enter();
  status = clt_hdf_create(temporary, path, &hdf, error);
  if (status == CLT_OK) {
    status = clt_hdf_complete(&hdf, write_transport(transport, &hdf, error), error);
  }
  clt_hdf_leave(session);
  if (status != CLT_OK) {
    clt_file_abandon(temporary);
    return status;
  }
  return clt_file_commit(temporary, path, error);
}
