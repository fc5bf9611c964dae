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

static int answer_json(const clt_effect_report *reports) {
  json_t *effects = json_array();
  for (int k = 0; k < CLT_EFFECTS; k++) {
    json_array_append_new(effects, report_json(&reports[k]));
  }
  return cli_print_json(json_pack("{s:o}", "effects", effects));
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

static int run(const cli_command *command, const cli_arguments *arguments) {
  clt_error error = {0};
  clt_scene *scene = NULL;
  clt_effect_report reports[CLT_EFFECTS];
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
  int code = CLI_DONE;
  if (status) {
    code = cli_fail(command, &error);
  } else if (arguments->json) {
    code = answer_json(reports);
  } else if (!arguments->quiet) {
    print_table(reports);
  }
  clt_scene_close(scene);
  return code;
}

static const char notes[] =
    "Every effect of the simulation, in the order in which light meets them: whether this scene calls for it and why,\n"
    "the time that opening the scene took for it, what it takes of each frame (of each new pattern, for what happens "
    "to\n"
    "light before it reaches the camera) and its memory. An effect that is off is neither prepared nor run.\n";

const cli_command cli_command_scene = {
    .name = "scene",
    .synopsis = "explain SCENE",
    .summary = "say which effects a scene calls for, why, and what each costs",
    .positional_least = 2,
    .positional_most = 2,
    .run = run,
    .notes = notes,
};
