/* What the demo leaves: pictures, the transport, the summary and the report. */
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "cli/answer.h"
#include "cli/demo.h"
#include "cli/folder.h"
#include "cli/report.h"

static json_t *timings_json(const demo *d) {
  const demo_timings *t = &d->timings;
  return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "scene_s", t->scene, "acquire_s", t->acquire, "certify_s",
                   t->certify, "solve_s", d->result.solve.seconds, "photograph_s", t->photograph, "reference_s",
                   t->reference, "total_s", t->total);
}

json_t *demo_summary(const demo *d) {
  const clt_provenance *origin = clt_transport_origin(d->transport);
  clt_transport_info info = clt_transport_describe(d->transport);
  json_t *summary = json_pack("{s:o, s:i, s:i, s:f}", "grid", cli_json_grid(&d->grid), "patterns", origin->patterns,
                              "frames", origin->frames, "acquire_s", d->timings.acquire);
  cli_json_add_compensation(summary, &d->result, d->grid.channels);
  /* the rig's photographs judge the result, not the prediction that the solver saw */
  json_object_set_new(summary, "error_predicted", cli_json_number(d->result.error_after));
  json_object_set_new(summary, "error_before", cli_json_number(d->before.error));
  json_object_set_new(summary, "error_after", cli_json_number(d->after.error));
  json_object_set_new(summary, "error_limit", cli_json_number(d->error_limit));
  json_object_set_new(summary, "error_exact_before", cli_json_number(d->before.exact_error));
  json_object_set_new(summary, "error_exact_after", cli_json_number(d->after.exact_error));
  json_object_set_new(summary, "observations", json_integer(DEMO_OBSERVATIONS));
  json_object_set_new(summary, "gain_before", cli_json_number(d->before.gain));
  json_object_set_new(summary, "acquire_error", origin->error < 0 ? json_null() : cli_json_number(origin->error));
  json_object_set_new(summary, "device_s", cli_json_number(origin->seconds));
  json_object_set_new(summary, "scheme", json_string(origin->scheme));
  json_object_set_new(summary, "storage", json_string(info.storage));
  json_object_set_new(summary, "scene", json_string(d->scene));
  json_object_set_new(summary, "target", json_string(d->target_path ? d->target_path : "built-in"));
  json_object_set_new(summary, "folder", json_string(d->folder));
  json_object_set_new(summary, "timings", timings_json(d));
  return summary;
}

static clt_status write_photograph(const char *path, const demo *d, const demo_sight *sight, clt_error *error) {
  double white[CLT_CHANNELS_MAX];
  for (int c = 0; c < d->grid.channels; c++) {
    white[c] = d->result.white[c] / sight->gain;
  }
  return cli_radiance_write(path, &sight->radiance, white, error);
}

static clt_status write_map(const char *path, const demo *d, const demo_sight *sight, clt_error *error) {
  clt_image map;
  clt_status status = clt_image_heatmap(&sight->error_map, d->map_top, &map, error);
  if (!status) {
    status = clt_image_write(path, NULL, &map, error);
    clt_image_finish(&map);
  }
  return status;
}

static clt_status write_target(const char *path, const demo *d, clt_error *error) {
  return clt_image_write(path, NULL, &d->picture, error);
}

static clt_status write_uncompensated(const char *path, const demo *d, clt_error *error) {
  return write_photograph(path, d, &d->before, error);
}

static clt_status write_compensated(const char *path, const demo *d, clt_error *error) {
  return write_photograph(path, d, &d->after, error);
}

static clt_status write_pattern(const char *path, const demo *d, clt_error *error) {
  return clt_panel_write(path, &d->panel, &d->drive, error);
}

static clt_status write_error_before(const char *path, const demo *d, clt_error *error) {
  return write_map(path, d, &d->before, error);
}

static clt_status write_error_after(const char *path, const demo *d, clt_error *error) {
  return write_map(path, d, &d->after, error);
}

static clt_status write_transport(const char *path, const demo *d, clt_error *error) {
  return clt_transport_save(d->transport, path, error);
}

/* Where the camera had to be calibrated. */
static clt_status write_calibration(const char *path, const demo *d, clt_error *error) {
  return d->station.calibration ? clt_calibration_save(d->station.calibration, path, error) : CLT_OK;
}

static clt_status write_summary(const char *path, const demo *d, clt_error *error) {
  json_t *summary = demo_summary(d);
  char *text = summary ? json_dumps(summary, JSON_INDENT(2)) : NULL;
  clt_status status = text ? clt_file_write(path, text, strlen(text), error)
                           : clt_fail(error, CLT_FAILED, "%s: the summary could not be put into JSON", path);
  free(text);
  json_decref(summary);
  return status;
}

/* The report comes last: it embeds the pictures. */
static const struct {
  const char *name;
  clt_status (*write)(const char *path, const demo *d, clt_error *error);
} results[] = {
    {"calibration.h5", write_calibration},      {"transport.h5", write_transport},      {"target.png", write_target},
    {"uncompensated.png", write_uncompensated}, {"compensated.png", write_compensated}, {"pattern.png", write_pattern},
    {"error-before.png", write_error_before},   {"error-after.png", write_error_after}, {"summary.json", write_summary},
    {"report.html", cli_report_write},
};

clt_status demo_write(const demo *d, clt_error *error) {
  clt_status status = cli_folder_make(d->folder, error);
  for (size_t i = 0; !status && i < sizeof results / sizeof *results; i++) {
    char path[CLT_PATH_MAX];
    status = clt_file_join(d->folder, results[i].name, path, error);
    if (!status) {
      status = results[i].write(path, d, error);
    }
  }
  return status;
}
