/* usage: vm_room SCENE LIGHT COMMANDS
 * Makes the file LIGHT, and publishes in it what the scene's camera sees of this display's screen. Reads lines from the
 * fifo COMMANDS: "save FILE" writes the exact radiance of every cell of the grid (.npy) under what is on the screen. */
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "../process.h"
#include "room.h"

static const int64_t PERIOD_NS = 1000000000 / 60;
static bool check(clt_status status, const clt_error *error) {
  if (status != CLT_OK) {
    fprintf(stderr, "room: %s\n", error->message);
  }
  return status == CLT_OK;
}

static void obey(const room *of, char *text) {
  for (char *line = strtok(text, "\n"); line != NULL; line = strtok(NULL, "\n")) {
    clt_error error = {0};
    if (strncmp(line, "save ", 5) == 0) {
      check(room_save(of, line + 5, &error), &error);
    } else {
      fprintf(stderr, "room: no command \"%s\"\n", line);
    }
  }
}

/* Commands that come before it is time for the next look. */
static void wait_until(int fifo, int64_t when_ns, const room *of) {
  for (int64_t left; !process_is_leaving() && (left = when_ns - process_now_ns()) > 0;) {
    struct pollfd watched = {fifo, POLLIN, 0};
    char text[4096];
    if (poll(&watched, 1, (int)((left + 999999) / 1000000)) > 0) {
      ssize_t got = read(fifo, text, sizeof text - 1);
      text[got > 0 ? got : 0] = '\0';
      obey(of, text);
    }
  }
}

static void run(screen *seen, room *of, light_ring *ring, int fifo) {
  clt_error error = {0};
  bool first = true;
  int64_t next_ns = process_now_ns();
  while (!process_is_leaving()) {
    int64_t looked_ns = process_now_ns();
    if ((screen_look(seen) || first) && check(room_light(of, seen->last, &error), &error)) {
      room_view(of, light_next(ring));
      light_publish(ring, looked_ns);
      first = false;
    }
    next_ns = next_ns + PERIOD_NS > looked_ns ? next_ns + PERIOD_NS : looked_ns;
    wait_until(fifo, next_ns, of);
  }
}

int main(int count, char **arguments) {
  screen seen = {0};
  room of = {0};
  light_ring ring = {0};
  clt_error error = {0};
  if (count != 4) {
    fprintf(stderr, "usage: vm_room SCENE LIGHT COMMANDS\n");
    return 2;
  }
  process_heed_signals();
  int fifo = open(arguments[3], O_RDWR | O_NONBLOCK);
  bool ready = fifo >= 0 && screen_open(&seen) &&
               check(room_open(arguments[1], seen.width, seen.height, &of, &error), &error) &&
               light_create(&ring, arguments[2], of.width, of.height);
  if (fifo < 0) {
    perror(arguments[3]);
  }
  if (ready) {
    run(&seen, &of, &ring, fifo);
  }
  light_close(&ring);
  room_close(&of);
  screen_close(&seen);
  return ready ? 0 : 1;
}
