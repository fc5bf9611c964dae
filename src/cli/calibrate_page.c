/* calibrate's report: what is wrong first, then everything that was measured, for the person who set the rig up. */
#include <math.h>
#include <stdarg.h>
#include <string.h>
#include <time.h>

#include "base/file.h"
#include "base/page.h"
#include "cli/calibrate_report.h"

enum { REGIONS_SHOWN = 6 };

static void put_row(FILE *page, const char *what, const char *remark, const char *format, ...) CLT_PRINTF(4, 5);
static void put_row(FILE *page, const char *what, const char *remark, const char *format, ...) {
  va_list arguments;
  fputs("<tr><td>", page);
  clt_page_text(page, what);
  fputs("</td><td class=\"soft\">", page);
  clt_page_text(page, remark);
  fputs("</td><td class=\"n\">", page);
  va_start(arguments, format);
  vfprintf(page, format, arguments);
  va_end(arguments);
  fputs("</td></tr>\n", page);
}

static int count_serious(const clt_findings *findings) {
  int count = 0;
  for (int k = 0; k < findings->count; k++) {
    count += findings->item[k].serious;
  }
  return count;
}

static void put_verdict(FILE *page, const cli_calibration *found) {
  const clt_calibration_info *info = &found->whole->info;
  int serious = count_serious(&found->findings);
  if (serious > 0) {
    fprintf(
        page,
        "<p class=\"lead\"><b>Not ready:</b> %s make%s what is measured with this rig wrong. Put right what is listed "
        "below, then calibrate again.</p>\n",
        serious == 1 ? "one thing" : "several things", serious == 1 ? "s" : "");
  } else {
    fprintf(page,
            "<p class=\"lead\"><b>Ready:</b> the camera sees %.1f&nbsp;%% of the panel, one pixel every "
            "%.2f&nbsp;panel pixels; light follows a picture by %.1f&nbsp;ms.</p>\n",
            100 * info->covered, info->pitch, 1e3 * info->latency_s);
  }
  char when[64] = "";
  time_t calibrated = (time_t)info->calibrated;
  struct tm utc;
  strftime(when, sizeof when, "%Y-%m-%d %H:%M UTC", gmtime_r(&calibrated, &utc));
  fputs("<p class=\"soft\">", page);
  clt_page_text(page, info->source);
  fprintf(page,
          ". Panel %d&nbsp;&times;&nbsp;%d, camera %d&nbsp;&times;&nbsp;%d, %s; %ld pictures, %ld frames, %ld taken "
          "again; %s.</p>\n",
          info->panel_width, info->panel_height, info->camera_width, info->camera_height,
          info->channels > 1 ? "colour" : "grey", found->whole->report->pictures, found->whole->report->frames,
          found->whole->report->retaken, when);
}

static void put_findings_of(FILE *page, const clt_findings *findings, bool serious) {
  for (int k = 0; k < findings->count; k++) {
    if (findings->item[k].serious == serious) {
      fprintf(page, "<tr><td>%s</td><td>", serious ? "<b style=\"color:var(--mark)\">Wrong</b>" : "Note");
      clt_page_text(page, findings->item[k].text);
      fputs("</td></tr>\n", page);
    }
  }
}

static void put_findings(FILE *page, const clt_findings *findings) {
  fputs("<h2>What is wrong, and what to do</h2>\n", page);
  if (findings->count == 0) {
    fputs("<p>Nothing was found wrong.</p>\n", page);
    return;
  }
  fputs("<table>\n", page);
  put_findings_of(page, findings, true);
  put_findings_of(page, findings, false);
  fputs("</table>\n", page);
}

/* Colours as clt_pixel_map_coverage paints them. */
static const struct {
  const char *colour, *meaning;
} fates[CLT_PIXEL_FATES] = {
    [CLT_PIXEL_DECODED] = {"linear-gradient(90deg,#404040,#c0c040)", "its place on the panel is known"},
    [CLT_PIXEL_UNLIT] = {"#000", "shadow, or beyond the picture; else a longer exposure"},
    [CLT_PIXEL_SATURATED] = {"#fff", "too bright: close the aperture, or a grey filter"},
    [CLT_PIXEL_AMBIGUOUS] = {"#00f", "drowns in noise: focus both lenses, darken the room"},
    [CLT_PIXEL_OUTSIDE] = {"#f0f", "a code beyond the panel: check the panel's size"},
    [CLT_PIXEL_ISOLATED] = {"#ff0", "at odds with its neighbours: edges in depth, nothing to do"},
    [CLT_PIXEL_DOUBLE] = {"#0ff", "lit from two places: mirrors, glossy or inner corners; cover them"},
};

static clt_status put_coverage(FILE *page, const char *folder, const cli_calibration *found, clt_error *error) {
  char path[CLT_PATH_MAX];
  const long *count = found->geometry.decode.count;
  clt_status status = clt_file_join(folder, "coverage.png", path, error);
  if (status) {
    return status;
  }
  fputs("<h2>What the camera sees</h2>\n<div class=\"pair\"><figure><img alt=\"Coverage\" src=\"", page);
  status = clt_page_embed(page, path, "png", error);
  fputs("\"><figcaption><b>The camera's picture</b><span>Where on the panel each pixel looks: red grows to the right, "
        "green downwards, with a dark line every sixteenth of the panel. Flat colours are masked.</span></figcaption>"
        "</figure>\n<div><table>\n",
        page);
  for (int fate = 0; fate < CLT_PIXEL_FATES; fate++) {
    fprintf(page,
            "<tr><td><span style=\"display:inline-block;width:1em;height:1em;border:1px solid var(--soft);background:"
            "%s\"></span> %s<br><span class=\"soft\">%s</span></td><td class=\"n\">%ld</td></tr>\n",
            fates[fate].colour, clt_pixel_fate_name((clt_pixel_fate)fate), fates[fate].meaning, count[fate]);
  }
  fputs("</table></div></div>\n", page);
  return status;
}

static void put_regions(FILE *page, const clt_regions *regions) {
  if (regions->count == 0) {
    return;
  }
  fputs("<h2>Masked regions</h2>\n<table>\n", page);
  for (int k = 0; k < regions->count && k < REGIONS_SHOWN; k++) {
    fputs("<tr><td>", page);
    clt_page_text(page, regions->region[k].text);
    fputs("</td></tr>\n", page);
  }
  if (regions->count + regions->others > REGIONS_SHOWN) {
    fprintf(page,
            "<tr><td class=\"soft\">and %ld smaller ones; <code>summary.json</code> has the larger of them</td></tr>\n",
            regions->count + regions->others - REGIONS_SHOWN);
  }
  fputs("</table>\n", page);
}

static void put_geometry(FILE *page, const cli_calibration *found) {
  const clt_decode_report *decode = &found->geometry.decode;
  const clt_epipolar *epipolar = &found->epipolar;
  fputs("<h2>Geometry</h2>\n<table>\n", page);
  put_row(page, "Panel seen", "share of the panel's pixels", "%.1f&nbsp;%%", 100 * found->whole->info.covered);
  put_row(page, "Pitch", "panel pixels from one camera pixel to the next; below 1 every panel pixel is resolved",
          "%.3f", decode->pitch);
  put_row(page, "Blur", "of stripes, panel pixels across and down; below 1 is in focus", "%.2f, %.2f", decode->blur[0],
          decode->blur[1]);
  put_row(page, "Roughness", "of the map from pixel to pixel, panel pixels; below 0.1 is good", "%.3f",
          found->roughness);
  if (epipolar->count > 0) {
    put_row(page, "Epipolar distance, median",
            epipolar->fitted ? found->whole->info.lens[0] > 0
                                   ? "camera pixels, of lines fitted to the map itself, the camera's lens straightened"
                                   : "camera pixels, of lines fitted to the map itself, lenses taken as straight"
                             : "camera pixels, of the lines of the given calibration",
            "%.3f", epipolar->median);
    put_row(page, "Epipolar distance, 90 %", "camera pixels", "%.3f", epipolar->upper);
  }
  fputs("</table>\n", page);
}

static void put_crosstalk(FILE *page, const clt_calibration_info *info) {
  static const char *const names[] = {"red", "green", "blue"};
  if (info->channels == 1) {
    return;
  }
  fputs("<h2>Crosstalk and black</h2>\n<table>\n<tr><td class=\"soft\">light seen in</td><td class=\"n soft\">of red"
        "</td><td class=\"n soft\">of green</td><td class=\"n soft\">of blue</td><td class=\"n soft\">black, of white"
        "</td></tr>\n",
        page);
  for (int c = 0; c < info->channels; c++) {
    fprintf(page, "<tr><td>%s</td>", names[c]);
    for (int k = 0; k < info->channels; k++) {
      double share = info->panel.mixes ? info->panel.crosstalk[c][k] : c == k;
      fprintf(page, "<td class=\"n\">%.4f</td>", share);
    }
    fprintf(page, "<td class=\"n\">%.5f</td></tr>\n", info->black[c]);
  }
  fputs(
      "</table>\n<p class=\"soft\">Black is what the dark panel lets through and the light of the room. Under 0.01 is "
      "good; above, darken the room.</p>\n",
      page);
}

static void put_photometry(FILE *page, const cli_calibration *found) {
  const clt_calibration_info *info = &found->whole->info;
  const clt_photometry_report *report = &found->whole->report->photometry;
  fputs("<h2>Responses</h2>\n<figure class=\"curve\">", page);
  cli_draw_responses(page, info);
  fprintf(page,
          "<figcaption><b>Code to light</b><span>The camera %s. White is %.2f&nbsp;%% off the sum of the single "
          "channels.</span></figcaption></figure>\n",
          info->camera.kind == CLT_CURVE_LINEAR ? "is linear" : "has a response of its own, which is undone",
          100 * report->projector.additivity);
  put_crosstalk(page, info);
  fputs("<h2>Noise</h2>\n<table>\n", page);
  if (info->channels == 1) {
    put_row(page, "Black", "of the dark panel, of white", "%.5f", info->black[0]);
  }
  put_row(page, "Full well", "electrons at full scale: photon transfer", "%.0f", info->full_well);
  put_row(page, "Read noise", "electrons", "%.1f", info->read_noise);
  put_row(page, "Black level", "code values without light", "%.2f", info->black_level);
  put_row(page, "Departure from photon noise", "times its uncertainty; a few are good, many mean a picture processed",
          "%.1f", report->noise.misfit);
  fputs("</table>\n<h2>Exposures</h2>\n<table>\n", page);
  put_row(page, "Of the fields and stripes", "the longest that leaves white unsaturated", "%.4g&nbsp;ms",
          1e3 * report->base_s);
  for (int k = 0; k < report->exposures.count; k++) {
    char name[32];
    snprintf(name, sizeof name, "%d of %d", k + 1, report->exposures.count);
    put_row(page, name, report->exposures.reason[k], "%.4g&nbsp;ms", 1e3 * report->exposures.seconds[k]);
  }
  fputs("</table>\n", page);
}

static void put_time(FILE *page, const clt_latency *latency) {
  fputs("<h2>Latency</h2>\n<figure class=\"curve\">", page);
  cli_draw_latency(page, latency);
  fprintf(page,
          "<figcaption><b>%d changes of light</b><span>each timed by the frames around it</span></figcaption></figure>"
          "\n<table>\n",
          latency->changes);
  put_row(page, "Latency", "from a refresh until its light", "%.1f&nbsp;ms", 1e3 * latency->seconds);
  put_row(page, "Uncertain by", "half of what fits equally well; gaps between exposures widen it", "%.1f&nbsp;ms",
          1e3 * latency->uncertain_s);
  put_row(page, "Jitter", "standard deviation; well under half a frame is good", "%.2f&nbsp;ms",
          1e3 * latency->jitter_s);
  put_row(page, "Complete after", "waited for after every picture, margin included", "%.1f&nbsp;ms",
          1e3 * latency->complete_s);
  put_row(page, "Frames", "lost, repeated, of another picture; all three should be 0", "%ld of %ld",
          latency->lost + latency->duplicates + latency->wrong, latency->frames);
  fputs("</table>\n", page);
}

static void put_steadiness(FILE *page, const cli_calibration *found) {
  const clt_photometry_report *report = &found->whole->report->photometry;
  const clt_locks *locks = &report->locks;
  const clt_drift *drift = &found->geometry.drift;
  double moved = 0;
  for (int c = 0; c < drift->channels; c++) {
    moved = fmax(moved, clt_drift_span(drift, c, false));
  }
  fputs("<h2>Steadiness</h2>\n<table>\n", page);
  if (locks->seconds > 0) {
    put_row(page, "Brightness after a change of picture", "automatic gain or exposure where above 1 %", "%.2f&nbsp;%%",
            100 * fabs(locks->gain));
    put_row(page, "Brightness that does not come back", "a lamp or camera that warms up", "%.2f&nbsp;%%",
            100 * locks->drift);
    put_row(page, "Ratio of red to blue", "automatic white balance where above 1.5 %", "%.2f&nbsp;%%",
            100 * locks->colour);
    put_row(page, "Sharpness", "automatic focus where above 6 %", "%.2f&nbsp;%%", 100 * locks->sharpness);
  } else {
    put_row(page, "Automatic controls", "were not watched for; see --watch", "&ndash;");
  }
  put_row(page, "Pattern + inverse", "over the structured light", "%.2f&nbsp;%%", 100 * moved);
  put_row(page, "Lamp", "over the ramps; divided out", "%.2f&nbsp;%%", 100 * report->projector.drift);
  if (report->flicker.hz > 0) {
    put_row(page, "Flicker", "of the room's light", "%.0f&nbsp;%% at %.0f&nbsp;Hz", 100 * report->flicker.depth,
            report->flicker.hz);
  } else {
    put_row(page, "Flicker", "of the room's light, at 100 or 120 Hz", "none seen");
  }
  fputs("</table>\n", page);
}

static const char usage[] =
    "<h2>How to use it</h2>\n<p>Name the file in the configuration; paths are relative to it:</p>\n"
    "<pre>rig = { calibration = \"calibration/calibration.h5\"; };</pre>\n"
    "<p class=\"soft\">It holds for these devices as they stand. Calibrate again after anything has moved, after a "
    "change "
    "of aperture, focus, zoom or picture mode, and after a new lamp.</p>\n";

static clt_status put_page(FILE *page, const char *folder, const cli_calibration *found, clt_error *error) {
  clt_page_begin(page, "counterlight: calibration");
  fputs("<h1>Calibration of projector and camera</h1>\n", page);
  put_verdict(page, found);
  put_findings(page, &found->findings);
  clt_status status = put_coverage(page, folder, found, error);
  put_regions(page, &found->geometry.regions);
  put_geometry(page, found);
  put_photometry(page, found);
  put_time(page, &found->whole->report->latency);
  put_steadiness(page, found);
  fputs(usage, page);
  fprintf(page, "<p class=\"soft\">counterlight %s. All numbers: <code>summary.json</code>.</p>\n", CLT_VERSION);
  clt_page_end(page);
  return status;
}

clt_status cli_calibration_page(const char *folder, const cli_calibration *found, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_text text;
  clt_status status = clt_file_join(folder, "report.html", path, error);
  if (status) {
    return status;
  }
  status = clt_text_open(&text, path, error);
  if (!status) {
    status = put_page(text.to, folder, found, error);
  }
  return clt_text_close(&text, status, error);
}
