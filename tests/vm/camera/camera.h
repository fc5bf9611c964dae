/* A simulated USB camera (USB Video Class 1.0, bulk), attached to the kernel's virtual host controller over a pair of
 * sockets: the kernel's own uvcvideo drives it.
 *
 *   usb.c       the host controller's messages (USB/IP): what is asked, and the answers
 *   uvc.c       what the camera says that it is, and the negotiation of a stream
 *   controls.c  exposure, gain, white balance, power line: ranges, values, refusals
 *   sensor.c    light to a picture
 *   faults.c    commands that make it fail
 *   main.c      frame after frame */
#ifndef VM_CAMERA_H
#define VM_CAMERA_H

#include <stdbool.h>
#include <stdint.h>

#include "../light.h"

typedef struct camera_options {
  int port; /* of the host controller */
  int width, height, rate_hz;
  const char *serial;
  const char *light;    /* file of the light; NULL: a pattern of the camera's own */
  const char *commands; /* fifo; NULL: none */
  unsigned seed;        /* of the noise */
} camera_options;

/* --- controls.c --- */
typedef struct camera_control {
  const char *name;
  uint8_t unit, selector, bytes;
  int32_t least, most, step, standard, value;
  bool refused;
} camera_control;
enum { CONTROL_COUNT = 7 };
typedef struct camera_controls {
  camera_control list[CONTROL_COUNT];
} camera_controls;
void controls_init(camera_controls *controls);
int32_t controls_value(const camera_controls *controls, const char *name);
camera_control *controls_find(camera_controls *controls, const char *name);
/* A class request to a unit. Answer bytes in data; returns their count, -1: refused. */
int controls_request(camera_controls *controls, uint8_t unit, uint8_t selector, uint8_t request, uint8_t *data,
                     int length);

/* --- faults.c --- */
typedef struct camera_faults {
  bool unplugged, stalled, frozen;
  int cut_short, wrong_size, damaged; /* so many frames more */
  double drift;                       /* of the sensitivity, a second */
  int64_t drift_from_ns;
  int fifo;
} camera_faults;
void faults_open(camera_faults *faults, const char *path);
/* Takes the commands that have come. */
void faults_take(camera_faults *faults, camera_controls *controls);
/* What the sensitivity has become. */
double faults_sensitivity(const camera_faults *faults);

/* --- uvc.c --- */
enum { UVC_DESCRIPTOR_MOST = 512, UVC_PROBE = 26, UVC_PAYLOAD = 16384, UVC_HEADER = 2 };
typedef struct uvc_stream {
  const camera_options *options;
  uint8_t configuration[UVC_DESCRIPTOR_MOST];
  int configuration_bytes;
  uint8_t probe[UVC_PROBE];
  uint32_t frame_bytes;
  bool configured; /* since it was last asked: the host has set the device up, as after a reset */
} uvc_stream;
void uvc_init(uvc_stream *stream, const camera_options *options);
/* A request on the control endpoint; as controls_request. */
int uvc_request(uvc_stream *stream, camera_controls *controls, const uint8_t setup[8], uint8_t *data, int length);

/* --- sensor.c --- */
typedef struct camera_sensor {
  const camera_options *options;
  light_ring light;
  float *seen;
  uint64_t noise;
  uint32_t frames;
} camera_sensor;
bool sensor_open(camera_sensor *sensor, const camera_options *options);
void sensor_close(camera_sensor *sensor);
/* A picture whose exposure ends now, as YUYV. */
void sensor_expose(camera_sensor *sensor, const camera_controls *controls, double sensitivity, uint8_t *yuyv);

/* --- usb.c --- */
enum { USB_QUEUE = 64, USB_TRANSFER_MOST = 1 << 20 };
typedef struct usb_request {
  uint32_t number, wanted; /* bytes */
} usb_request;
typedef struct usb_link {
  int socket; /* -1: unplugged */
  usb_request queue[USB_QUEUE];
  int first, waiting; /* reads of the stream that wait for data */
  uint8_t buffer[USB_TRANSFER_MOST];
} usb_link;
bool usb_plug(usb_link *link, int port);
void usb_unplug(usb_link *link);
/* Reads one message of the host and answers it, or queues it. False where the host has gone. */
bool usb_serve(usb_link *link, uvc_stream *stream, camera_controls *controls);
/* Answers the first waiting read. */
void usb_answer(usb_link *link, const uint8_t *data, int bytes);

#endif
