#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "../process.h"
#include "camera.h"

typedef struct camera {
  camera_options options;
  camera_controls controls;
  camera_faults faults;
  camera_sensor sensor;
  uvc_stream stream;
  usb_link link;
  uint8_t *frame;
  uint8_t toggle; /* of the frames' identity bit */
  uint32_t sent;  /* bytes of the frame */
  bool sending;
  int64_t next_ns;
} camera;

static bool take_one(int *count) {
  bool any = *count > 0;
  *count -= any;
  return any;
}

/* How many bytes of the frame are sent in all: a fault may end it early. */
static uint32_t frame_end(camera *self) {
  uint32_t whole = self->stream.frame_bytes;
  return self->faults.cut_short > 0 ? whole / 3 : self->faults.wrong_size > 0 ? whole / 2 : whole;
}

/* The next piece of the frame: two bytes of head (end of frame, error, identity), then samples. */
static void send_payload(camera *self) {
  uint8_t out[UVC_PAYLOAD];
  uint32_t end = frame_end(self), left = end > self->sent ? end - self->sent : 0; /* a fault may come in between */
  uint32_t bytes = left < UVC_PAYLOAD - UVC_HEADER ? left : UVC_PAYLOAD - UVC_HEADER;
  bool last = bytes == left;
  out[0] = UVC_HEADER;
  out[1] = (uint8_t)(0x80 | (last ? 2 : 0) | (self->faults.damaged > 0 ? 0x40 : 0) | self->toggle);
  for (uint32_t i = 0; i < bytes; i++) {
    out[UVC_HEADER + i] = self->frame[self->sent + i];
  }
  usb_answer(&self->link, out, (int)(UVC_HEADER + bytes));
  self->sent += bytes;
  if (last) {
    self->sending = false;
    self->toggle ^= 1;
    if (!take_one(&self->faults.cut_short) && !take_one(&self->faults.wrong_size)) {
      take_one(&self->faults.damaged);
    }
  }
}

/* A frame is sent when its exposure has ended, at the camera's rate. */
static void pump(camera *self) {
  int64_t now = process_now_ns(), period = INT64_C(1000000000) / self->options.rate_hz;
  if (!self->sending && self->link.waiting > 0 && now >= self->next_ns && !self->faults.stalled) {
    if (!self->faults.frozen) {
      sensor_expose(&self->sensor, &self->controls, faults_sensitivity(&self->faults), self->frame);
    }
    self->sending = true;
    self->sent = 0;
    self->next_ns = self->next_ns + period > now - period ? self->next_ns + period : now + period;
  }
  while (self->sending && self->link.waiting > 0 && !self->faults.stalled) {
    send_payload(self);
  }
}

static void mind_plug(camera *self) {
  if (self->faults.unplugged && self->link.socket >= 0) {
    usb_unplug(&self->link);
    self->sending = false;
  } else if (!self->faults.unplugged && self->link.socket < 0) {
    controls_init(&self->controls);
    self->faults.stalled = false;
    self->faults.unplugged = !usb_plug(&self->link, self->options.port);
  }
}

/* The host has set the device up: after a reset a stall is over, and the controls are as from the factory. */
static void mind_reset(camera *self) {
  if (self->stream.configured) {
    self->stream.configured = false;
    self->faults.stalled = self->sending = false;
    controls_init(&self->controls);
  }
}

static int wait_ms(const camera *self) {
  int64_t left = self->next_ns - process_now_ns();
  if (self->link.waiting == 0 || self->faults.stalled) {
    return 1000;
  }
  return left > 0 ? (int)(left / 1000000) + 1 : 0;
}

/* False where waiting is not possible. */
static bool turn(camera *self) {
  struct pollfd watched[] = {{self->link.socket, POLLIN, 0}, {self->faults.fifo, POLLIN, 0}};
  mind_plug(self);
  watched[0].fd = self->link.socket;
  if (poll(watched, 2, wait_ms(self)) < 0 && errno != EINTR) {
    return false;
  }
  if (watched[1].revents & POLLIN) {
    faults_take(&self->faults, &self->controls);
  }
  if (self->link.socket >= 0 && watched[0].revents != 0 && !usb_serve(&self->link, &self->stream, &self->controls)) {
    usb_unplug(&self->link);
    self->faults.unplugged = true;
  }
  mind_reset(self);
  if (self->link.socket >= 0) {
    pump(self);
  }
  return true;
}

static bool read_options(int count, char **arguments, camera_options *options) {
  *options = (camera_options){.width = 320, .height = 240, .rate_hz = 30, .serial = "CL0001", .seed = 1};
  for (int option; (option = getopt(count, arguments, "p:r:w:h:s:l:c:n:")) > 0;) {
    switch (option) {
    case 'p':
      options->port = atoi(optarg);
      break;
    case 'r':
      options->rate_hz = atoi(optarg);
      break;
    case 'w':
      options->width = atoi(optarg);
      break;
    case 'h':
      options->height = atoi(optarg);
      break;
    case 's':
      options->serial = optarg;
      break;
    case 'l':
      options->light = optarg;
      break;
    case 'c':
      options->commands = optarg;
      break;
    case 'n':
      options->seed = (unsigned)atoi(optarg);
      break;
    default:
      return false;
    }
  }
  return options->rate_hz > 0 && options->width > 0 && options->width % 2 == 0 && options->height > 0;
}

int main(int count, char **arguments) {
  static camera self;
  if (!read_options(count, arguments, &self.options)) {
    fprintf(stderr,
            "usage: vm_camera [-p PORT] [-r HZ] [-w WIDTH] [-h HEIGHT] [-s SERIAL] [-l LIGHT] [-c FIFO] [-n SEED]\n");
    return 2;
  }
  process_heed_signals();
  self.link.socket = -1;
  self.next_ns = process_now_ns();
  controls_init(&self.controls);
  uvc_init(&self.stream, &self.options);
  faults_open(&self.faults, self.options.commands);
  self.frame = calloc(1, self.stream.frame_bytes);
  if (self.frame == NULL || !sensor_open(&self.sensor, &self.options)) {
    return 1;
  }
  while (!process_is_leaving() && turn(&self)) {
  }
  usb_unplug(&self.link);
  sensor_close(&self.sensor);
  free(self.frame);
  return 0;
}
