/* The messages of USB/IP (the kernel's Documentation/usb/usbip_protocol.rst), all in network order: 48 bytes, then
 * data. */
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include "camera.h"

enum { SUBMIT = 1, UNLINK = 2, RETURN_SUBMIT = 3, RETURN_UNLINK = 4, HIGH_SPEED = 3 };

typedef struct message {
  uint32_t command, number, device, direction, endpoint;
  uint32_t second, length, start, packets, interval; /* flags, or the number to unlink; status, in answers */
  uint8_t setup[8];
} message;

static bool read_all(int fd, void *to, size_t bytes) {
  for (char *at = to; bytes > 0;) {
    ssize_t got = read(fd, at, bytes);
    if (got <= 0) {
      return false;
    }
    at += got;
    bytes -= (size_t)got;
  }
  return true;
}

static void write_all(int fd, const void *from, size_t bytes) {
  for (const char *at = from; bytes > 0;) {
    ssize_t sent = write(fd, at, bytes);
    if (sent <= 0) {
      return; /* the host has gone: the next read tells */
    }
    at += sent;
    bytes -= (size_t)sent;
  }
}

static void reply(const usb_link *link, uint32_t command, uint32_t number, int status, const void *data, int bytes) {
  message out = {.command = htonl(command), .number = htonl(number), .second = htonl((uint32_t)status)};
  out.length = command == RETURN_SUBMIT ? htonl((uint32_t)bytes) : 0;
  write_all(link->socket, &out, sizeof out);
  if (data != NULL) {
    write_all(link->socket, data, (size_t)bytes);
  }
}

bool usb_plug(usb_link *link, int port) {
  int ends[2], most = 4 << 20;
  char line[64];
  link->socket = -1;
  link->first = link->waiting = 0;
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    perror("socketpair");
    return false;
  }
  for (int k = 0; k < 2; k++) {
    setsockopt(ends[k], SOL_SOCKET, SO_SNDBUF, &most, sizeof most);
  }
  int attach = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY | O_CLOEXEC);
  int length = snprintf(line, sizeof line, "%d %d %d %d", port, ends[1], 1 << 16 | (2 + port), HIGH_SPEED);
  bool plugged = attach >= 0 && write(attach, line, (size_t)length) == length;
  if (!plugged) {
    perror("attaching to the virtual host controller");
    close(ends[0]);
  }
  if (attach >= 0) {
    close(attach);
  }
  close(ends[1]);
  link->socket = plugged ? ends[0] : -1;
  return plugged;
}

void usb_unplug(usb_link *link) {
  if (link->socket >= 0) {
    close(link->socket);
  }
  link->socket = -1;
  link->waiting = 0;
}

void usb_answer(usb_link *link, const uint8_t *data, int bytes) {
  usb_request request = link->queue[link->first];
  link->first = (link->first + 1) % USB_QUEUE;
  link->waiting--;
  int most = (int)request.wanted;
  reply(link, RETURN_SUBMIT, request.number, 0, data, bytes < most ? bytes : most);
}

/* A request that is taken back: -ECONNRESET tells that it was still waiting. */
static void unlink_request(usb_link *link, uint32_t own, uint32_t number) {
  int kept = 0, found = 0;
  for (int k = 0; k < link->waiting; k++) {
    usb_request request = link->queue[(link->first + k) % USB_QUEUE];
    if (request.number == number) {
      found = 1;
    } else {
      link->queue[(link->first + kept++) % USB_QUEUE] = request;
    }
  }
  link->waiting = kept;
  reply(link, RETURN_UNLINK, own, found ? -ECONNRESET : 0, NULL, 0);
}

/* The interrupt endpoint has nothing to say: its reads wait for ever. */
static void submit(usb_link *link, uvc_stream *stream, camera_controls *controls, const message *in) {
  uint32_t number = ntohl(in->number), endpoint = ntohl(in->endpoint), length = ntohl(in->length);
  if (endpoint == 0) {
    int bytes = uvc_request(stream, controls, in->setup, link->buffer, (int)length);
    bool reads = ntohl(in->direction) != 0;
    reply(link, RETURN_SUBMIT, number, bytes < 0 ? -EPIPE : 0, reads && bytes > 0 ? link->buffer : NULL,
          bytes < 0 ? 0
          : reads   ? bytes
                    : (int)length);
  } else if (endpoint == 1 && link->waiting < USB_QUEUE) {
    link->queue[(link->first + link->waiting++) % USB_QUEUE] = (usb_request){number, length};
  } else if (endpoint == 1) {
    reply(link, RETURN_SUBMIT, number, -EPROTO, NULL, 0);
  }
}

bool usb_serve(usb_link *link, uvc_stream *stream, camera_controls *controls) {
  message in;
  if (!read_all(link->socket, &in, sizeof in)) {
    return false;
  }
  uint32_t command = ntohl(in.command), length = ntohl(in.length);
  if (command == UNLINK) {
    unlink_request(link, ntohl(in.number), ntohl(in.second));
    return true;
  }
  bool brings = ntohl(in.direction) == 0 && length > 0;
  if (command != SUBMIT || (brings && (length > USB_TRANSFER_MOST || !read_all(link->socket, link->buffer, length)))) {
    return false;
  }
  submit(link, stream, controls, &in);
  return true;
}
