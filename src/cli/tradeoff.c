/* counterlight tradeoff: what accuracy costs in time, measured. */
#include "counterlight/tradeoff.h"

#include <stdio.h>

#include "cli/command.h"
#include "cli/folder.h"
#include "cli/progress.h"
#include "cli/solve_options.h"
#include "cli/transport_input.h"
#include "tradeoff/json.h"

static const cli_option options[] = {
    {"target", 't', "PIC", "the picture to make appear"},
    {"output", 'o', "DIR", "folder of the results (default: tradeoff)"},
    {"white", 'w', "W", "radiance of the picture's white: a number, auto or feasible"},
    {"tolerance", 0, "X", "choose the fastest that is at most this far off"},
    {"deadline-ms", 0, "X", "choose the nearest within this time"},
    {"seconds", 's', "X", "time to spend on measuring, roughly (default 45)"},
    {"drives", 0, NULL, "also leave the drive of every solve, drive-NUMBER.npy"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Solves for PIC by every method, with T in every storage, stopped at tolerance after tolerance, and leaves in\n"
    "DIR tradeoff.html to read, tradeoff.svg (error against time) and tradeoff.csv (every solve: its time, its\n"
    "error, and how much of that solver, storage, the limits 0..1 and the camera's noise make).\n"
    "Without --tolerance and --deadline-ms the fastest is chosen after which more time makes no visible difference.\n"
    "A method that is refused, or that would take more than its share of --seconds, is left out and named.\n";

typedef struct task {
  const char *target;
  char folder[CLT_PATH_MAX];
  clt_tradeoff_options asked;
  cli_input input;
  clt_image picture;
  clt_tradeoff found;
} task;

static bool tell(void *context, const char *what, int done, int steps) {
  char text[96];
  snprintf(text, sizeof text, "%s (%d of %d)", what, done + 1, steps);
  cli_progress_note(context, text);
  return !cli_interrupted();
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  clt_solve_options solve;
  clt_status status = cli_required(command, arguments, "target", &t->target, error);
  if (!status) {
    status = cli_folder_choose(cli_value(command, arguments, "output"), "tradeoff", t->folder, error);
  }
  if (!status) {
    status = cli_solve_options(command, arguments, &solve, &t->asked.white, error);
  }
  if (!status) {
    status = cli_number(command, arguments, "seconds", 0.1, 1e5, &t->asked.seconds, error);
  }
  if (!status) {
    t->asked.tolerance = solve.tolerance;
    t->asked.deadline_s = solve.deadline_s;
    t->asked.drives = cli_value(command, arguments, "drives") != NULL ? t->folder : NULL;
  }
  return status;
}

static clt_status work(const char *transport, task *t, clt_error *error) {
  clt_status status = cli_input_open(transport, &t->input, error);
  if (!status) {
    status = cli_picture_read(t->target, NULL, &t->input.grid, &t->picture, error);
  }
  if (!status && t->asked.drives) {
    status = cli_folder_make(t->folder, error);
  }
  if (!status) {
    status = clt_tradeoff_measure(t->input.transport, t->input.certificate, &t->picture, &t->asked, &t->found, error);
  }
  if (!status) {
    status = cli_folder_make(t->folder, error);
  }
  return status ? status : clt_tradeoff_write(&t->found, t->folder, error);
}

static int answer(const cli_arguments *arguments, const task *t) {
  const clt_tradeoff_point *chosen = &t->found.points[t->found.chosen];
  if (arguments->json) {
    json_t *document = clt_tradeoff_json(&t->found);
    json_object_set_new(document, "output", json_string(t->folder));
    return cli_print_json(document);
  }
  if (!arguments->quiet) {
    printf("%s\n", t->found.sentence);
    printf("chosen: %s, T stored as %s, %d iterations, %.3g ms (made ready in %.3g ms), %.3g %% off: %s\n",
           chosen->method, chosen->storage, chosen->iterations, 1e3 * chosen->seconds, 1e3 * chosen->prepare_seconds,
           100 * chosen->error, t->found.chosen_why);
    printf("%zu solves; look at %s/tradeoff.html\n", t->found.count, t->folder);
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  cli_progress progress;
  t.asked.progress = tell;
  t.asked.context = &progress;
  cli_progress_begin(&progress, arguments->quiet);
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = work(arguments->positional[0], &t, &error);
  }
  cli_progress_end(&progress);
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  clt_tradeoff_finish(&t.found);
  clt_image_finish(&t.picture);
  cli_input_close(&t.input);
  return code;
}

const cli_command cli_command_tradeoff = {
    .name = "tradeoff",
    .synopsis = "T.h5 --target PIC [-o DIR] [options]",
    .summary = "measure what accuracy costs in time",
    .options = options,
    .positional_least = 1,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
