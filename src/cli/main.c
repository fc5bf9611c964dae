/* counterlight COMMAND: finds the command's table entry and runs it. */
#include <stdio.h>
#include <string.h>

#include "cli/command.h"

/* In the order in which --help lists them. */
static const cli_command *const commands[] = {
    &cli_command_demo,       &cli_command_doctor,  &cli_command_calibrate, &cli_command_acquire,
    &cli_command_compensate, &cli_command_relight, &cli_command_bounces,   &cli_command_separate,
    &cli_command_repaint,    &cli_command_inspect, &cli_command_tradeoff,  &cli_command_reproduce,
    &cli_command_simulate,   &cli_command_scene,   &cli_command_bench,     &cli_command_status,
    &cli_command_show,       &cli_command_watch,   &cli_command_reacquire, &cli_command_refine,
    &cli_command_snapshot,   &cli_command_hold,    &cli_command_resume,    &cli_command_reload,
};
enum { COMMANDS = sizeof commands / sizeof *commands };

static void print_commands(FILE *stream) {
  fputs("usage: counterlight COMMAND [options]\n\n"
        "Makes a projector show what the artist meant: measures how the room carries light,\n"
        "inverts that, and projects the picture that looks right after all the bouncing.\n\n",
        stream);
  for (int i = 0; i < COMMANDS; i++) {
    fprintf(stream, "  %-12s %s\n", commands[i]->name, commands[i]->summary);
  }
  fputs("\ncounterlight COMMAND --help describes one; counterlight --version prints the version.\n", stream);
}

static int run_command(const cli_command *command, int count, char *const *words) {
  cli_arguments arguments;
  bool wants_help;
  clt_error error = {0};
  if (cli_parse(command, count, words, &arguments, &wants_help, &error)) {
    return cli_fail(command, &error);
  }
  if (wants_help) {
    cli_help(command, stdout);
    return CLI_DONE;
  }
  return command->run(command, &arguments);
}

int main(int count, char **words) {
  const char *name = count > 1 ? words[1] : NULL;
  if (!name) {
    print_commands(stderr);
    return CLI_BAD_USAGE;
  }
  if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0) {
    print_commands(stdout);
    return CLI_DONE;
  }
  if (strcmp(name, "--version") == 0) {
    puts("counterlight " CLT_VERSION);
    return CLI_DONE;
  }
  for (int i = 0; i < COMMANDS; i++) {
    if (strcmp(commands[i]->name, name) == 0) {
      return run_command(commands[i], count - 2, words + 2);
    }
  }
  fprintf(stderr, "counterlight: there is no command '%s'; counterlight --help lists them\n", name);
  return CLI_BAD_USAGE;
}
