/* Reading a command's words by its table of options, and saying how it went. */
#include "cli/command.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Options that every command knows. */
static const cli_option common_options[] = {{"json", 0, NULL, "print one JSON document on stdout"},
                                            {"quiet", 'q', NULL, "print nothing but errors"},
                                            {"help", 'h', NULL, "print this"},
                                            {NULL, 0, NULL, NULL}};

typedef struct reader {
  const cli_command *command;
  int count, next; /* words, and the one to read next */
  char *const *words;
  cli_arguments *arguments;
  bool *wants_help;
  bool words_only; /* after "--" */
} reader;

/* Index in options of the one that is called name (length characters; one character also means the letter). */
static int option_index(const cli_option *options, const char *name, size_t length, bool is_letter) {
  for (int i = 0; options && options[i].name; i++) {
    bool same = is_letter ? options[i].letter == *name
                          : strlen(options[i].name) == length && strncmp(options[i].name, name, length) == 0;
    if (same) {
      return i;
    }
  }
  return -1;
}

static void take_common(reader *r, int index) {
  const char *name = common_options[index].name;
  if (strcmp(name, "json") == 0) {
    r->arguments->json = true;
  } else if (strcmp(name, "quiet") == 0) {
    r->arguments->quiet = true;
  } else {
    *r->wants_help = true;
  }
}

/* One option: `attached` is what stands in the same word as its argument ("--name=attached", "-nattached"), or NULL. */
static clt_status take_option(reader *r, const char *name, size_t length, bool is_letter, const char *attached,
                              clt_error *error) {
  const char *dashes = is_letter ? "-" : "--";
  const cli_option *options = r->command->options;
  int index = option_index(options, name, length, is_letter);
  int common = index < 0 ? option_index(common_options, name, length, is_letter) : -1;
  if (index < 0 && common < 0) {
    return clt_fail(error, CLT_BAD_INPUT, "there is no option %s%.*s; counterlight %s --help lists them", dashes,
                    (int)length, name, r->command->name);
  }
  const cli_option *option = index >= 0 ? &options[index] : &common_options[common];
  if (!option->argument) {
    if (attached) {
      return clt_fail(error, CLT_BAD_INPUT, "%s%.*s takes no argument", dashes, (int)length, name);
    }
    if (index >= 0) {
      r->arguments->value[index] = "";
    } else {
      take_common(r, common);
    }
    return CLT_OK;
  }
  if (!attached && r->next >= r->count) {
    return clt_fail(error, CLT_BAD_INPUT, "%s%.*s needs an argument: %s", dashes, (int)length, name, option->argument);
  }
  r->arguments->value[index] = attached ? attached : r->words[r->next++];
  return CLT_OK;
}

static clt_status take_word(reader *r, clt_error *error) {
  const char *word = r->words[r->next++];
  if (!r->words_only && strcmp(word, "--") == 0) {
    r->words_only = true;
    return CLT_OK;
  }
  if (!r->words_only && word[0] == '-' && word[1] == '-') {
    const char *name = word + 2, *equals = strchr(name, '=');
    return take_option(r, name, equals ? (size_t)(equals - name) : strlen(name), false, equals ? equals + 1 : NULL,
                       error);
  }
  if (!r->words_only && word[0] == '-' && word[1]) {
    return take_option(r, word + 1, 1, true, word[2] ? word + 2 : NULL, error);
  }
  if (r->arguments->positional_count >= r->command->positional_most) {
    return clt_fail(error, CLT_BAD_INPUT, "'%s' is one word too many; usage: counterlight %s %s", word,
                    r->command->name, r->command->synopsis);
  }
  r->arguments->positional[r->arguments->positional_count++] = word;
  return CLT_OK;
}

/* The word of the synopsis that stands for the next positional argument. */
static clt_status fail_missing(const cli_command *command, int given, clt_error *error) {
  const char *word = command->synopsis;
  for (int k = 0; k < given; k++) {
    word += strcspn(word, " ");
    word += strspn(word, " ");
  }
  return clt_fail(error, CLT_BAD_INPUT, "%.*s is missing; usage: counterlight %s %s", (int)strcspn(word, " ,"), word,
                  command->name, command->synopsis);
}

clt_status cli_parse(const cli_command *command, int count, char *const *words, cli_arguments *arguments,
                     bool *wants_help, clt_error *error) {
  reader r = {.command = command, .count = count, .words = words, .arguments = arguments, .wants_help = wants_help};
  memset(arguments, 0, sizeof *arguments);
  *wants_help = false;
  while (r.next < count && !*wants_help) {
    clt_status status = take_word(&r, error);
    if (status) {
      return status;
    }
  }
  if (!*wants_help && arguments->positional_count < command->positional_least) {
    return fail_missing(command, arguments->positional_count, error);
  }
  return CLT_OK;
}

static void print_options(const cli_option *options, FILE *stream) {
  for (; options && options->name; options++) {
    char left[64];
    snprintf(left, sizeof left, "%c%c%s --%s%s%s", options->letter ? '-' : ' ', options->letter ? options->letter : ' ',
             options->letter ? "," : " ", options->name, options->argument ? " " : "",
             options->argument ? options->argument : "");
    fprintf(stream, "  %-26s %s\n", left, options->help);
  }
}

void cli_help(const cli_command *command, FILE *stream) {
  fprintf(stream, "usage: counterlight %s%s%s\n\n%s\n\n", command->name, *command->synopsis ? " " : "",
          command->synopsis, command->summary);
  print_options(command->options, stream);
  print_options(common_options, stream);
  if (command->notes) {
    fprintf(stream, "\n%s", command->notes);
  }
}

const char *cli_value(const cli_command *command, const cli_arguments *arguments, const char *name) {
  int index = option_index(command->options, name, strlen(name), false);
  return index < 0 ? NULL : arguments->value[index];
}

clt_status cli_number(const cli_command *command, const cli_arguments *arguments, const char *name, double low,
                      double high, double *value, clt_error *error) {
  const char *text = cli_value(command, arguments, name);
  if (!text) {
    return CLT_OK;
  }
  char *end = NULL;
  double number = strtod(text, &end);
  if (end == text || *end || !(number >= low && number <= high)) {
    return clt_fail(error, CLT_BAD_INPUT, "--%s: '%s' is not a number from %g to %g", name, text, low, high);
  }
  *value = number;
  return CLT_OK;
}

clt_status cli_integer(const cli_command *command, const cli_arguments *arguments, const char *name, int low, int high,
                       int *value, clt_error *error) {
  double number = *value;
  clt_status status = cli_number(command, arguments, name, low, high, &number, error);
  if (status) {
    return status;
  }
  if (number != floor(number)) {
    return clt_fail(error, CLT_BAD_INPUT, "--%s: '%s' is not a whole number from %d to %d", name,
                    cli_value(command, arguments, name), low, high);
  }
  *value = (int)number;
  return CLT_OK;
}

clt_status cli_required(const cli_command *command, const cli_arguments *arguments, const char *name,
                        const char **value, clt_error *error) {
  *value = cli_value(command, arguments, name);
  if (*value && **value) {
    return CLT_OK;
  }
  int index = option_index(command->options, name, strlen(name), false);
  return clt_fail(error, CLT_BAD_INPUT, "--%s %s is missing; usage: counterlight %s %s", name,
                  command->options[index].argument, command->name, command->synopsis);
}

int cli_fail(const cli_command *command, const clt_error *error) {
  fprintf(stderr, "counterlight %s: %s\n", command->name, error->message);
  return error->status == CLT_BAD_INPUT ? CLI_BAD_USAGE : CLI_FAILED;
}

int cli_print_json(json_t *document) {
  int failed = !document || json_dumpf(document, stdout, JSON_INDENT(2)) || putchar('\n') == EOF || fflush(stdout);
  json_decref(document);
  if (failed) {
    fprintf(stderr, "counterlight: the JSON answer could not be written to stdout\n");
    return CLI_FAILED;
  }
  return CLI_DONE;
}
