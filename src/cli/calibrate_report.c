#include "cli/calibrate_report.h"

#include "base/file.h"
#include "cli/answer.h"
#include "cli/folder.h"
#include "cli/light_files.h"

static clt_status write_image(const char *folder, const char *name, const clt_image *image, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = clt_file_join(folder, name, path, error);
  return status ? status : clt_image_write(path, NULL, image, error);
}

static clt_status write_pictures(const char *folder, const clt_pixel_map *map, clt_error *error) {
  clt_image image = {0};
  clt_status status = cli_folder_make(folder, error);
  if (!status) {
    status = clt_pixel_map_image(map, &image, error);
  }
  if (!status) {
    status = write_image(folder, "map.npy", &image, error);
  }
  clt_image_finish(&image);
  if (!status) {
    status = clt_pixel_map_coverage(map, &image, error);
  }
  if (!status) {
    status = write_image(folder, "coverage.png", &image, error);
  }
  clt_image_finish(&image);
  return status;
}

static json_t *json_fates(const clt_decode_report *decode) {
  json_t *object = json_object();
  for (int fate = 0; fate < CLT_PIXEL_FATES; fate++) {
    json_object_set_new(object, clt_pixel_fate_name(fate), json_integer(decode->count[fate]));
  }
  return object;
}

static json_t *json_regions(const clt_regions *regions) {
  json_t *array = json_array();
  for (int k = 0; k < regions->count; k++) {
    const clt_region *region = &regions->region[k];
    json_array_append_new(array, json_pack("{s:s, s:I, s:[i, i, i, i], s:s}", "fate", clt_pixel_fate_name(region->fate),
                                           "pixels", (json_int_t)region->pixels, "box", region->left, region->top,
                                           region->right, region->bottom, "why", region->text));
  }
  return array;
}

static json_t *json_drift(const clt_drift *drift) {
  json_t *channels = json_array();
  for (int c = 0; c < drift->channels; c++) {
    json_array_append_new(channels, json_pack("{s:f, s:f}", "all", clt_drift_span(drift, c, false), "wide",
                                              clt_drift_span(drift, c, true)));
  }
  return channels;
}

static json_t *json_findings(const clt_findings *findings) {
  json_t *array = json_array();
  for (int k = 0; k < findings->count; k++) {
    json_array_append_new(
        array, json_pack("{s:b, s:s}", "serious", findings->item[k].serious, "text", findings->item[k].text));
  }
  return array;
}

static json_t *json_epipolar(const clt_epipolar *epipolar) {
  return epipolar->count == 0 ? json_null()
                              : json_pack("{s:b, s:I, s:f, s:f, s:I, s:f, s:f}", "fitted", epipolar->fitted, "pixels",
                                          (json_int_t)epipolar->count, "median", epipolar->median, "p90",
                                          epipolar->upper, "sure_pixels", (json_int_t)epipolar->sure, "sure_median",
                                          epipolar->sure_median, "sure_p90", epipolar->sure_upper);
}

static json_t *summary(const char *folder, const cli_calibration *found) {
  const clt_geometry *geometry = &found->geometry;
  const clt_pixel_map *map = &geometry->map;
  const clt_decode_report *decode = &geometry->decode;
  return json_pack("{s:s, s:[i, i], s:[i, i], s:o, s:f, s:[f, f], s:f, s:o, s:o, s:I, s:o, s:o}", "output", folder,
                   "camera", map->width, map->height, "panel", map->panel_width, map->panel_height, "fates",
                   json_fates(decode), "pitch", decode->pitch, "blur", decode->blur[0], decode->blur[1], "noise",
                   decode->noise, "epipolar", json_epipolar(&found->epipolar), "regions",
                   json_regions(&geometry->regions), "smaller_regions", (json_int_t)geometry->regions.others, "drift",
                   json_drift(&geometry->drift), "findings", json_findings(&found->findings));
}

static void print_found(const char *folder, const cli_calibration *found) {
  const clt_decode_report *decode = &found->geometry.decode;
  const clt_epipolar *epipolar = &found->epipolar;
  const clt_regions *regions = &found->geometry.regions;
  printf("%s: %ld of %ld camera pixels decoded, %.2f panel pixels from one to the next, blur %.2f x %.2f\n", folder,
         decode->count[CLT_PIXEL_DECODED], (long)found->geometry.map.width * found->geometry.map.height, decode->pitch,
         decode->blur[0], decode->blur[1]);
  if (epipolar->count > 0) {
    printf(
        "distance from epipolar lines (%s), camera pixels: median %.3f, 90 %% under %.3f; of the more confident half "
        "%.3f, %.3f\n",
        epipolar->fitted ? "fitted to this map" : "of the reference", epipolar->median, epipolar->upper,
        epipolar->sure_median, epipolar->sure_upper);
  }
  printf("masked:");
  for (int fate = CLT_PIXEL_UNLIT; fate < CLT_PIXEL_FATES; fate++) {
    printf("%s %ld %s", fate > CLT_PIXEL_UNLIT ? "," : "", decode->count[fate], clt_pixel_fate_name(fate));
  }
  putchar('\n');
  for (int k = 0; k < regions->count; k++) {
    printf("  %s\n", regions->region[k].text);
  }
  if (regions->others > 0) {
    printf("  and %ld smaller regions\n", regions->others);
  }
  for (int k = 0; k < found->findings.count; k++) {
    printf("%s: %s\n", found->findings.item[k].serious ? "WRONG" : "note", found->findings.item[k].text);
  }
}

clt_status cli_calibration_write(const char *folder, const cli_calibration *found, const cli_arguments *arguments,
                                 clt_error *error) {
  clt_status status = write_pictures(folder, &found->geometry.map, error);
  if (status) {
    return status;
  }
  json_t *document = summary(folder, found);
  status = cli_summary_write(folder, document, error);
  if (!status && arguments->json) {
    return cli_print_json(document) == CLI_DONE ? CLT_OK : clt_fail(error, CLT_FAILED, "stdout cannot be written");
  }
  json_decref(document);
  if (!status && !arguments->quiet) {
    print_found(folder, found);
  }
  return status;
}
