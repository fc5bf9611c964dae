/* The commands of `counterlight`: one table entry each, one file a command or family of commands. */
#ifndef CLT_CLI_COMMAND_H
#define CLT_CLI_COMMAND_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

#include "counterlight/status.h"

enum { CLI_OPTIONS_MAX = 16, CLI_POSITIONAL_MAX = 4 };

/* Exit codes (contract: scripts rely on them). */
enum { CLI_DONE = 0, CLI_FAILED = 1, CLI_BAD_USAGE = 2 };

/* One option of a command. --help, --json and -q/--quiet are known to every command and not listed. */
typedef struct cli_option {
  const char *name;     /* without the dashes; NULL ends the list */
  char letter;          /* short form, or 0 */
  const char *argument; /* name of its argument for --help; NULL: a flag */
  const char *help;
} cli_option;

typedef struct cli_arguments {
  bool json, quiet;
  const char
      *value[CLI_OPTIONS_MAX]; /* parallel to the command's options: the argument, "" for a flag, NULL if absent */
  const char *positional[CLI_POSITIONAL_MAX];
  int positional_count;
} cli_arguments;

typedef struct cli_command {
  const char *name;
  const char *synopsis; /* "T.h5 --target PIC -o OUT" */
  const char *summary;  /* one line */
  const cli_option *options;
  int positional_least, positional_most;
  /* Returns an exit code. What fails is said once, by cli_fail. */
  int (*run)(const struct cli_command *command, const cli_arguments *arguments);
  const char *notes; /* what --help says after the options, lines ended by \n; or NULL */
} cli_command;

/* Reads the count words after the command's name into arguments, whose texts point into words. *wants_help where one
 * of them is --help (the rest is then not checked). CLT_BAD_INPUT for an unknown option, a missing or surplus argument
 * and too few or too many positional words. */
clt_status cli_parse(const cli_command *command, int count, char *const *words, cli_arguments *arguments,
                     bool *wants_help, clt_error *error);
/* Writes the command's manual (usage, options, notes) to stream. */
void cli_help(const cli_command *command, FILE *stream);

/* The argument of the option called name, or NULL where it was not given. */
const char *cli_value(const cli_command *command, const cli_arguments *arguments, const char *name);
/* Reads a number option within low..high into *value (left as it is where the option is absent). */
clt_status cli_number(const cli_command *command, const cli_arguments *arguments, const char *name, double low,
                      double high, double *value, clt_error *error);
/* The same for whole numbers. */
clt_status cli_integer(const cli_command *command, const cli_arguments *arguments, const char *name, int low, int high,
                       int *value, clt_error *error);
/* The argument of an option that must be given; CLT_BAD_INPUT where it was not. */
clt_status cli_required(const cli_command *command, const cli_arguments *arguments, const char *name,
                        const char **value, clt_error *error);

/* Prints "counterlight NAME: message" on stderr; returns CLI_BAD_USAGE for CLT_BAD_INPUT, else CLI_FAILED. */
int cli_fail(const cli_command *command, const clt_error *error);
/* Prints one JSON document on stdout and frees it. Returns CLI_DONE, or CLI_FAILED where stdout cannot be written. */
int cli_print_json(json_t *document);

extern const cli_command cli_command_demo, cli_command_acquire, cli_command_compensate, cli_command_relight,
    cli_command_bounces, cli_command_separate, cli_command_repaint, cli_command_inspect, cli_command_tradeoff,
    cli_command_reproduce, cli_command_simulate, cli_command_scene, cli_command_calibrate, cli_command_doctor,
    cli_command_bench;

/* The commands that talk to a running daemon (client.c): status reacquire refine show watch snapshot hold resume
 * reload. */
extern const cli_command cli_command_status, cli_command_reacquire, cli_command_refine, cli_command_show,
    cli_command_watch, cli_command_snapshot, cli_command_hold, cli_command_resume, cli_command_reload;

#endif
