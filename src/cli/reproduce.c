/* counterlight reproduce: the report's tables and figures that rest on simulation, computed again. */
#include "counterlight/reproduce.h"

#include <stdio.h>

#include "cli/command.h"
#include "cli/folder.h"
#include "cli/progress.h"

enum { QUICK = 1280 };

static const cli_option options[] = {
    {"output", 'o', "DIR", "folder of the results (default: reproduced)"},
    {"largest", 0, "N", "cells of the largest size of Fig. 10: 80, 320, 1280, 5120 or 10240 (the default)"},
    {"quick", 0, NULL, "the same as --largest 1280"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Computes Table 1 and Figs. 5 to 13 of Bai et al. 2010 again, and leaves in DIR reproduce.html, which sets the\n"
    "report's numbers beside these, and each figure as .csv and .svg or .png. Charts need gnuplot.\n"
    "Fig. 10 at N = 10240 takes most of the time and 5 GB; --quick stops at 1280, in seconds.\n";

static bool tell(void *context, const char *part, int done, int parts) {
  char text[64];
  snprintf(text, sizeof text, "%s (%d of %d)", part, done + 1, parts);
  cli_progress_note(context, text);
  return !cli_interrupted();
}

/* Fig. 10's sizes; the report's. */
static clt_status check_size(int largest, clt_error *error) {
  static const int sizes[] = {0, 80, 320, 1280, 5120, 10240};
  for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++) {
    if (largest == sizes[k]) {
      return CLT_OK;
    }
  }
  return clt_fail(error, CLT_BAD_INPUT, "--largest: %d is no size of Fig. 10; take 80, 320, 1280, 5120 or 10240",
                  largest);
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, char *folder,
                               clt_reproduce_options *options_out, clt_error *error) {
  clt_status status = cli_folder_choose(cli_value(command, arguments, "output"), "reproduced", folder, error);
  options_out->largest = cli_value(command, arguments, "quick") ? QUICK : 0;
  if (!status) {
    status = cli_integer(command, arguments, "largest", 80, 10240, &options_out->largest, error);
  }
  if (!status) {
    status = check_size(options_out->largest, error);
  }
  if (!status) {
    status = cli_scenes_folder(&options_out->scenes, error);
  }
  options_out->folder = folder;
  return status ? status : cli_folder_make(folder, error);
}

static int answer(const cli_arguments *arguments, const clt_reproduction *found, const char *folder) {
  json_t *rows = json_array();
  int passed = 0;
  for (int k = 0; k < found->count; k++) {
    const clt_reproduced *row = &found->rows[k];
    passed += row->pass;
    json_array_append_new(rows, json_pack("{s:s, s:s, s:s, s:b}", "name", row->name, "report", row->report, "ours",
                                          row->ours, "pass", row->pass));
    if (!arguments->json && !arguments->quiet) {
      printf("%s %-24s %s\n%33s%s\n", row->pass ? "as said" : "DIFFERS", row->name, row->report, "here: ", row->ours);
    }
  }
  if (arguments->json) {
    return cli_print_json(json_pack("{s:o, s:i, s:s}", "rows", rows, "passed", passed, "output", folder));
  }
  json_decref(rows);
  if (!arguments->quiet) {
    printf("%d of %d as the report says, or better; look at %s/reproduce.html\n", passed, found->count, folder);
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  char folder[CLT_PATH_MAX];
  clt_error error = {0};
  cli_progress progress;
  clt_reproduction found = {0};
  clt_reproduce_options asked = {.progress = tell, .context = &progress};
  cli_progress_begin(&progress, arguments->quiet);
  clt_status status = read_options(command, arguments, folder, &asked, &error);
  if (!status) {
    status = clt_reproduce(&asked, &found, &error);
  }
  cli_progress_end(&progress);
  return status ? cli_fail(command, &error) : answer(arguments, &found, folder);
}

const cli_command cli_command_reproduce = {
    .name = "reproduce",
    .synopsis = "[-o DIR] [--quick | --largest N]",
    .summary = "compute the report's tables and figures again",
    .options = options,
    .run = run,
    .notes = notes,
};
