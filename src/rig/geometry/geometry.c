#include "rig/geometry/geometry.h"

#include <stdlib.h>

#include "base/memory.h"

enum { REGION_SHARE = 25000 }; /* part of the camera's pixels that a masked region is worth a line from */
#define SATURATED_SHARE 0.01   /* of the lit pixels */
#define AMBIGUOUS_SHARE 0.1
#define DECODED_SHARE 0.6 /* of the lit pixels: below it much of the picture is not mapped */

static clt_status show_and_take(clt_shots *shots, const clt_geometry_options *options, float *codes, clt_pairs *pairs,
                                clt_error *error) {
  int pictures = clt_gray_pictures(&options->gray);
  for (int k = 0; k < pictures; k++) {
    int64_t complete_ns = 0;
    clt_frame frame;
    clt_gray_draw(&options->gray, k, shots->panel.channels, codes);
    clt_status status = clt_shots_show(shots, codes, &complete_ns, error);
    if (status == CLT_OK) {
      status = clt_shots_take(shots, complete_ns, options->exposure_s, &frame, error);
    }
    if (status != CLT_OK) {
      return clt_fail_within(error, "structured light, picture %d of %d: ", k + 1, pictures);
    }
    clt_pairs_add(pairs, k, &frame);
    if (options->progress != NULL && !options->progress(options->context, k + 1, pictures)) {
      return clt_fail(error, CLT_CANCELLED, "structured light was stopped after %d of %d pictures", k + 1, pictures);
    }
  }
  return CLT_OK;
}

static clt_status collect(clt_shots *shots, const clt_geometry_options *options, clt_pairs *pairs, clt_error *error) {
  const clt_gray *gray = &options->gray;
  if (gray->panel_width != shots->panel.width || gray->panel_height != shots->panel.height) {
    return clt_fail(error, CLT_BAD_INPUT, "a Gray code of %d x %d pixels for a panel of %d x %d", gray->panel_width,
                    gray->panel_height, shots->panel.width, shots->panel.height);
  }
  clt_status status = clt_pairs_init(pairs, gray, &shots->sensor, &options->response, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t codes = (size_t)gray->panel_width * (size_t)gray->panel_height * (size_t)shots->panel.channels;
  float *panel = clt_alloc(codes, sizeof *panel);
  status = panel != NULL ? show_and_take(shots, options, panel, pairs, error)
                         : clt_fail(error, CLT_FAILED, "out of memory for a panel of %zu codes", codes);
  free(panel);
  return status;
}

/* What most of the lit pixels are that were not decoded. */
static clt_pixel_fate find_worst(const long count[CLT_PIXEL_FATES]) {
  clt_pixel_fate worst = CLT_PIXEL_AMBIGUOUS;
  for (clt_pixel_fate fate = 0; fate < CLT_PIXEL_FATES; fate++) {
    if (fate != CLT_PIXEL_DECODED && fate != CLT_PIXEL_UNLIT && count[fate] > count[worst]) {
      worst = fate;
    }
  }
  return worst;
}

static void judge_map(const clt_geometry *geometry, clt_findings *findings) {
  const long *count = geometry->decode.count;
  long lit = 0;
  for (int fate = 0; fate < CLT_PIXEL_FATES; fate++) {
    lit += fate != CLT_PIXEL_UNLIT ? count[fate] : 0;
  }
  if (count[CLT_PIXEL_DECODED] == 0) {
    clt_findings_add(findings, true,
                     "no camera pixel was decoded (%ld lit): check that the camera sees the picture, its exposure, and "
                     "the panel's size",
                     lit);
    return;
  }
  if ((double)count[CLT_PIXEL_DECODED] < DECODED_SHARE * (double)lit) {
    const clt_pixel_fate worst = find_worst(count);
    clt_findings_add(findings, true,
                     "only %.1f %% of the %ld lit pixels were decoded; %ld are %s: see the masked regions for where, "
                     "expose longer, focus both lenses, and keep mirrors and other light out of the picture",
                     100.0 * (double)count[CLT_PIXEL_DECODED] / (double)lit, lit, count[worst],
                     clt_pixel_fate_name(worst));
  }
  if ((double)count[CLT_PIXEL_SATURATED] > SATURATED_SHARE * (double)lit) {
    clt_findings_add(findings, false, "%.1f %% of the lit pixels are saturated: expose shorter",
                     100.0 * (double)count[CLT_PIXEL_SATURATED] / (double)lit);
  }
  if ((double)count[CLT_PIXEL_AMBIGUOUS] > AMBIGUOUS_SHARE * (double)lit) {
    clt_findings_add(findings, false,
                     "%.1f %% of the lit pixels are ambiguous: expose longer, focus both lenses, darken the room",
                     100.0 * (double)count[CLT_PIXEL_AMBIGUOUS] / (double)lit);
  }
}

static clt_status decode(const clt_geometry_options *options, clt_pairs *pairs, clt_geometry *geometry,
                         clt_findings *findings, clt_error *error) {
  uint8_t *detail = clt_alloc(pairs->pixels, sizeof *detail);
  if (detail == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for the fates of %zu pixels", pairs->pixels);
  }
  clt_status status = clt_decode(pairs, &geometry->map, detail, &geometry->decode, error);
  if (status == CLT_OK) {
    status = clt_drift_measure(pairs, &geometry->drift, error);
  }
  long least = options->region_pixels > 0 ? options->region_pixels : (long)pairs->pixels / REGION_SHARE + 1;
  clt_pairs_finish(pairs);
  if (status == CLT_OK) {
    status = clt_regions_find(&geometry->map, detail, least, &geometry->regions, error);
  }
  free(detail);
  if (status == CLT_OK) {
    clt_drift_judge(&geometry->drift, findings);
    judge_map(geometry, findings);
  }
  return status;
}

clt_status clt_geometry_measure(clt_shots *shots, const clt_geometry_options *options, clt_geometry *geometry,
                                clt_findings *findings, clt_error *error) {
  clt_pairs pairs = {0};
  *geometry = (clt_geometry){0};
  clt_status status = collect(shots, options, &pairs, error);
  if (status == CLT_OK) {
    status = decode(options, &pairs, geometry, findings, error);
  }
  clt_pairs_finish(&pairs);
  if (status != CLT_OK) {
    clt_geometry_finish(geometry);
  }
  return status;
}

void clt_geometry_finish(clt_geometry *geometry) {
  clt_pixel_map_finish(&geometry->map);
  *geometry = (clt_geometry){0};
}
