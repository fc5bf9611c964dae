/* Commands, one a line: unplug, plug, stall, freeze, thaw, short N, size N, damage N, refuse CONTROL, allow CONTROL,
 * drift PER_SECOND. A stall ends when the host sets the device up again. */
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../process.h"
#include "camera.h"

/* Open for writing too, so that a writer that leaves does not end it. */
void faults_open(camera_faults *faults, const char *path) {
  *faults = (camera_faults){.fifo = path != NULL ? open(path, O_RDWR | O_NONBLOCK) : -1};
  if (path != NULL && faults->fifo < 0) {
    perror(path);
  }
}

static void obey(camera_faults *faults, camera_controls *controls, char *line) {
  char *word = strtok(line, " "), *rest = strtok(NULL, " ");
  if (word == NULL) {
    return;
  }
  const struct {
    const char *name;
    bool *flag, value;
  } flags[] = {{"unplug", &faults->unplugged, true},
               {"plug", &faults->unplugged, false},
               {"stall", &faults->stalled, true},
               {"freeze", &faults->frozen, true},
               {"thaw", &faults->frozen, false}};
  for (size_t i = 0; i < sizeof flags / sizeof flags[0]; i++) {
    if (strcmp(word, flags[i].name) == 0) {
      *flags[i].flag = flags[i].value;
      return;
    }
  }
  const struct {
    const char *name;
    int *count;
  } counts[] = {{"short", &faults->cut_short}, {"size", &faults->wrong_size}, {"damage", &faults->damaged}};
  for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
    if (strcmp(word, counts[i].name) == 0) {
      *counts[i].count = rest != NULL ? atoi(rest) : 1;
      return;
    }
  }
  camera_control *control = rest != NULL ? controls_find(controls, rest) : NULL;
  if (control != NULL && (strcmp(word, "refuse") == 0 || strcmp(word, "allow") == 0)) {
    control->refused = word[0] == 'r';
  } else if (strcmp(word, "drift") == 0 && rest != NULL) {
    faults->drift = atof(rest);
    faults->drift_from_ns = process_now_ns();
  } else {
    fprintf(stderr, "camera: no command \"%s\"\n", word);
  }
}

void faults_take(camera_faults *faults, camera_controls *controls) {
  char text[512];
  ssize_t got = faults->fifo >= 0 ? read(faults->fifo, text, sizeof text - 1) : 0;
  if (got <= 0) {
    return;
  }
  text[got] = '\0';
  for (char *line = text, *end; *line != '\0'; line = end) {
    end = line + strcspn(line, "\n");
    end += *end != '\0' ? (*end = '\0', 1) : 0;
    obey(faults, controls, line);
  }
}

double faults_sensitivity(const camera_faults *faults) {
  return faults->drift == 0 ? 1 : exp(faults->drift * (double)(process_now_ns() - faults->drift_from_ns) * 1e-9);
}
