/* What calibrate found, as JSON. */
#include "cli/answer.h"
#include "cli/calibrate_report.h"

enum { RESPONSE_LEVELS = 17 };

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

json_t *cli_findings_json(const clt_findings *findings) {
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

json_t *cli_geometry_json(const cli_calibration *found) {
  const clt_geometry *geometry = &found->geometry;
  const clt_pixel_map *map = &geometry->map;
  const clt_decode_report *decode = &geometry->decode;
  return json_pack("{s:[i, i], s:[i, i], s:o, s:f, s:[f, f], s:f, s:o, s:o, s:I, s:o}", "camera", map->width,
                   map->height, "panel", map->panel_width, map->panel_height, "fates", json_fates(decode), "pitch",
                   decode->pitch, "blur", decode->blur[0], decode->blur[1], "noise", decode->noise, "epipolar",
                   json_epipolar(&found->epipolar), "regions", json_regions(&geometry->regions), "smaller_regions",
                   (json_int_t)geometry->regions.others, "drift", json_drift(&geometry->drift));
}

static json_t *json_latency(const clt_latency *latency) {
  json_t *counts = json_array();
  for (int k = 0; k < CLT_LATENCY_BINS; k++) {
    json_array_append_new(counts, json_integer(latency->histogram[k]));
  }
  return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:i, s:I, s:I, s:I, s:I, s:f, s:{s:f, s:f, s:o}}", "seconds",
                   latency->seconds, "jitter", latency->jitter_s, "earliest", latency->earliest_s, "latest",
                   latency->latest_s, "complete", latency->complete_s, "uncertain", latency->uncertain_s, "misfit",
                   latency->misfit, "changes", latency->changes, "frames", (json_int_t)latency->frames, "lost",
                   (json_int_t)latency->lost, "duplicates", (json_int_t)latency->duplicates, "wrong",
                   (json_int_t)latency->wrong, "frame", latency->frame_s, "histogram", "first", latency->bin_first_s,
                   "bin", latency->bin_s, "counts", counts);
}

/* Light at the codes of RESPONSE_LEVELS equal steps. */
static json_t *json_curve(const clt_curve *curve) {
  double light[RESPONSE_LEVELS];
  for (int k = 0; k < RESPONSE_LEVELS; k++) {
    light[k] = clt_curve_decode(curve, k / (RESPONSE_LEVELS - 1.0));
  }
  return cli_json_numbers(light, RESPONSE_LEVELS);
}

static json_t *json_projector(const clt_calibration_info *info, const clt_projector_photometry *measured) {
  json_t *responses = json_array(), *crosstalk = json_array();
  for (int c = 0; c < info->channels; c++) {
    double row[CLT_PANEL_CHANNELS];
    for (int k = 0; k < info->channels; k++) {
      row[k] = info->panel.mixes ? info->panel.crosstalk[c][k] : c == k;
    }
    json_array_append_new(responses, json_curve(&info->panel.response[c]));
    json_array_append_new(crosstalk, cli_json_numbers(row, info->channels));
  }
  return json_pack("{s:o, s:o, s:o, s:f, s:f, s:f}", "response", responses, "crosstalk", crosstalk, "black",
                   cli_json_numbers(info->black, info->channels), "additivity", measured->additivity, "drift",
                   measured->drift, "largest_fall", measured->largest_fall);
}

static json_t *json_camera(const clt_calibration_info *info, const clt_photometry_report *report) {
  const clt_camera_response *camera = &report->camera;
  return json_pack("{s:o, s:b, s:f, s:f, s:[f, f], s:f, s:f, s:f, s:f, s:i}", "response", json_curve(&info->camera),
                   "linear", info->camera.kind == CLT_CURVE_LINEAR, "proportion", camera->proportion, "residual",
                   camera->residual, "covered", camera->covered[0], camera->covered[1], "black_level",
                   info->black_level, "full_well", info->full_well, "read_noise", info->read_noise, "noise_misfit",
                   report->noise.misfit, "noise_points", report->noise.points);
}

static json_t *json_exposures(const clt_photometry_report *report) {
  json_t *array = json_array();
  for (int k = 0; k < report->exposures.count; k++) {
    json_array_append_new(
        array, json_pack("{s:f, s:s}", "seconds", report->exposures.seconds[k], "why", report->exposures.reason[k]));
  }
  return array;
}

static json_t *json_locks(const clt_locks *locks) {
  return json_pack("{s:f, s:f, s:f, s:f, s:o, s:f}", "gain", locks->gain, "drift", locks->drift, "colour",
                   locks->colour, "sharpness", locks->sharpness, "obedience", cli_json_number(locks->obedience),
                   "watched", locks->seconds);
}

json_t *cli_calibration_json(const char *folder, const cli_calibration *found) {
  const clt_calibration_info *info = &found->whole->info;
  const clt_calibration_report *report = found->whole->report;
  const clt_photometry_report *photometry = &report->photometry;
  json_t *geometry = cli_geometry_json(found);
  json_object_set_new(geometry, "covered", json_real(info->covered));
  json_object_set_new(geometry, "roughness", json_real(found->roughness));
  return json_pack(
      "{s:s, s:s, s:I, s:i, s:o, s:o, s:o, s:f, s:o, s:{s:f, s:f}, s:o, s:o, s:I, s:I, s:I, s:f, s:o}", "output",
      folder, "source", info->source, "calibrated", (json_int_t)info->calibrated, "channels", info->channels, "latency",
      json_latency(&report->latency), "projector", json_projector(info, &photometry->projector), "camera",
      json_camera(info, photometry), "base_exposure", photometry->base_s, "exposures", json_exposures(photometry),
      "flicker", "hz", photometry->flicker.hz, "depth", photometry->flicker.depth, "locks",
      photometry->locks.seconds > 0 ? json_locks(&photometry->locks) : json_null(), "geometry", geometry, "pictures",
      (json_int_t)report->pictures, "frames", (json_int_t)report->frames, "retaken", (json_int_t)report->retaken,
      "seconds", report->seconds, "findings", cli_findings_json(&found->findings));
}
