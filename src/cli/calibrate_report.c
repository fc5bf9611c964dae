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

static void print_whole(const cli_calibration *found) {
  const clt_calibration_info *info = &found->whole->info;
  printf("latency %.1f ms, jitter %.1f ms; pictures are complete after %.1f ms\n", 1e3 * info->latency_s,
         1e3 * info->jitter_s, 1e3 * info->complete_s);
  printf("black");
  for (int c = 0; c < info->channels; c++) {
    printf(" %.5f", info->black[c]);
  }
  printf(" of white; camera %s, full well %.0f electrons, read noise %.1f\nexposures",
         info->camera.kind == CLT_CURVE_LINEAR ? "linear" : "with a response curve", info->full_well, info->read_noise);
  for (int k = 0; k < info->exposure_count; k++) {
    printf("%s %.4g", k > 0 ? "," : "", 1e3 * info->exposures_s[k]);
  }
  printf(" ms; %.1f %% of the panel is seen\n", 100 * info->covered);
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
  if (found->whole != NULL) {
    print_whole(found);
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

static clt_status write_whole(const char *folder, const cli_calibration *found, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = clt_file_join(folder, "calibration.h5", path, error);
  if (!status) {
    status = clt_calibration_save(found->whole, path, error);
  }
  return status ? status : cli_calibration_page(folder, found, error);
}

static json_t *summary(const char *folder, const cli_calibration *found) {
  if (found->whole != NULL) {
    return cli_calibration_json(folder, found);
  }
  json_t *document = cli_geometry_json(found);
  json_object_set_new(document, "output", json_string(folder));
  json_object_set_new(document, "findings", cli_findings_json(&found->findings));
  return document;
}

clt_status cli_calibration_write(const char *folder, const cli_calibration *found, const cli_arguments *arguments,
                                 clt_error *error) {
  clt_status status = write_pictures(folder, &found->geometry.map, error);
  if (!status && found->whole != NULL) {
    status = write_whole(folder, found, error);
  }
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
