#include "daemon/options.h"

#include <getopt.h>
#include <stdio.h>

bool daemon_options_read(int count, char **arguments, daemon_options *options) {
  static const struct option known[] = {
      {"config", required_argument, NULL, 'c'},
      {"socket", required_argument, NULL, 's'},
      {"state", required_argument, NULL, 'd'},
      {"check", no_argument, NULL, 'k'},
      {"states", no_argument, NULL, 'g'},
      {"help", no_argument, NULL, 'h'},
      {"version", no_argument, NULL, 'V'},
      {"try-transport", required_argument, NULL, 't'},
      {NULL, 0, NULL, 0},
  };
  *options = (daemon_options){0};
  for (int letter; (letter = getopt_long(count, arguments, "c:hV", known, NULL)) != -1;) {
    switch (letter) {
    case 'c':
      options->config = optarg;
      break;
    case 's':
      options->overrides.socket = optarg;
      break;
    case 'd':
      options->overrides.state = optarg;
      break;
    case 'k':
      options->check = true;
      break;
    case 'g':
      options->states = true;
      break;
    case 'h':
      options->help = true;
      break;
    case 't':
      options->transport = optarg;
      break;
    case 'V':
      options->version = true;
      break;
    default:
      return false;
    }
  }
  bool needs_config = !options->states && !options->help && !options->version && options->transport == NULL;
  if (optind < count || (needs_config && options->config == NULL)) {
    fprintf(stderr, "counterlightd: %s; see counterlightd --help\n",
            optind < count ? "takes no arguments but options" : "needs --config FILE");
    return false;
  }
  return true;
}

void daemon_options_help(void) {
  puts("counterlightd --config FILE [OPTIONS]\n"
       "Keeps a compensated picture on a projector; runs in the foreground.\n\n"
       "  -c, --config FILE   the configuration (docs/configuration.md)\n"
       "      --check         read the configuration and all that it names, say OK or what is wrong, and end\n"
       "      --socket PATH   control socket, in place of the configuration's\n"
       "      --state DIR     state directory, in place of the configuration's\n"
       "      --states        print the state machine as a Graphviz digraph and end\n"
       "      --try-transport FILE\n"
       "                      load a transport and end: 0 where it is whole, else 2\n"
       "  -h, --help\n"
       "  -V, --version\n\n"
       "Exit: 0 stopped by a signal; 1 failed; 2 bad usage or configuration.");
}
