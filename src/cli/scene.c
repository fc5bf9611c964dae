/* counterlight scene explain: which effects a scene calls for, why, and what each costs. */
#include <string.h>

#include "cli/answer.h"
#include "cli/command.h"
#include "counterlight/scene.h"

static json_t *report_json(const clt_effect_report *report) {
  return json_pack("{s:s, s:b, s:s, s:o, s:o, s:I}", "name", report->name, "on", report->on, "why", report->why,
                   "prepare_ms", cli_json_number(report->prepare_ms), "frame_ms", cli_json_number(report->frame_ms),
                   "bytes", (json_int_t)report->bytes);
}

static json_t *pixels_json(const clt_pixels_report *pixels) {
  return json_pack("{s:f, s:f, s:f, s:f, s:o, s:o, s:I}", "lit", pixels->lit, "shadowed", pixels->shadowed, "outside",
                   pixels->outside, "nothing", pixels->nothing, "prepare_ms", cli_json_number(pixels->prepare_ms),
                   "frame_ms", cli_json_number(pixels->frame_ms), "bytes", (json_int_t)pixels->bytes);
}

static int answer_json(const clt_effect_report *reports, const clt_pixels_report *pixels) {
  json_t *effects = json_array();
  for (int k = 0; k < CLT_EFFECTS; k++) {
    json_array_append_new(effects, report_json(&reports[k]));
  }
  json_t *document = json_pack("{s:o}", "effects", effects);
  if (pixels->own) {
    json_object_set_new(document, "pixels", pixels_json(pixels));
  }
  return cli_print_json(document);
}

static void format_bytes(size_t bytes, char text[16]) {
  if (bytes >= 1000000) {
    snprintf(text, 16, "%.1f MB", 1e-6 * (double)bytes);
  } else if (bytes >= 1000) {
    snprintf(text, 16, "%.1f kB", 1e-3 * (double)bytes);
  } else {
    snprintf(text, 16, "%zu B", bytes);
  }
}

static void print_table(const clt_effect_report *reports) {
  printf("%-18s %-3s %12s %12s %10s  %s\n", "effect", "", "preparation", "per frame", "memory", "why");
  for (int k = 0; k < CLT_EFFECTS; k++) {
    const clt_effect_report *report = &reports[k];
    if (report->on) {
      char bytes[16];
      format_bytes(report->bytes, bytes);
      printf("%-18s on  %9.2f ms %9.4f ms %10s  %s\n", report->name, report->prepare_ms, report->frame_ms, bytes,
             report->why);
    } else {
      printf("%-18s off %12s %12s %10s  %s\n", report->name, "-", "-", "-", report->why);
    }
  }
}

/* Of a camera with pixels of its own. */
static void print_pixels(const clt_pixels_report *pixels) {
  char bytes[16];
  format_bytes(pixels->bytes, bytes);
  printf(
      "%-18s on  %9.2f ms %9.4f ms %10s  of what they see %.1f %% is lit, %.1f %% in the projector's shadow, %.1f %% "
      "beyond its picture, %.1f %% no surface\n",
      "own pixels", pixels->prepare_ms, pixels->frame_ms, bytes, 100.0 * pixels->lit, 100.0 * pixels->shadowed,
      100.0 * pixels->outside, 100.0 * pixels->nothing);
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  clt_error error = {0};
  clt_scene *scene = NULL;
  clt_effect_report reports[CLT_EFFECTS];
  clt_pixels_report pixels;
  clt_status status = CLT_OK;
  if (strcmp(arguments->positional[0], "explain") != 0) {
    status = clt_fail(&error, CLT_BAD_INPUT, "'%s' is not known; usage: counterlight scene %s",
                      arguments->positional[0], command->synopsis);
  }
  if (!status) {
    status = clt_scene_open(arguments->positional[1], &scene, &error);
  }
  if (!status) {
    status = clt_scene_effects(scene, reports, &error);
  }
  if (!status) {
    status = clt_scene_pixels(scene, &pixels, &error);
  }
  int code = CLI_DONE;
  if (status) {
    code = cli_fail(command, &error);
  } else if (arguments->json) {
    code = answer_json(reports, &pixels);
  } else if (!arguments->quiet) {
    print_table(reports);
    if (pixels.own) {
      print_pixels(&pixels);
    }
  }
  clt_scene_close(scene);
  return code;
}

static const char notes[] =
    "Every effect of the simulation, in the order in which light meets them: whether this scene calls for it and why,\n"
    "the time that opening the scene took for it, what it takes of each frame (of each new pattern, for what happens "
    "to\n"
    "light before it reaches the camera) and its memory. An effect that is off is neither prepared nor run.\n"
    "Where the camera has pixels of its own, the last line says what they see, and what that costs.\n";

const cli_command cli_command_scene = {
    .name = "scene",
    .synopsis = "explain SCENE",
    .summary = "say which effects a scene calls for, why, and what each costs",
    .positional_least = 2,
    .positional_most = 2,
    .run = run,
    .notes = notes,
};
