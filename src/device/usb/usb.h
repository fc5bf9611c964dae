/* USB devices: telling which one, waiting until it is there, and resetting one that hangs (libusb). */
#ifndef CLT_DEVICE_USB_USB_H
#define CLT_DEVICE_USB_USB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"

/* Which device, or what is known of one. */
typedef struct clt_usb_id {
  int vendor, product; /* < 0: any */
  char serial[128];    /* empty: any, or it has none */
  char port[64];       /* "BUS-PORT[.PORT...]" as in /sys/bus/usb/devices; empty: any */
} clt_usb_id;

/* Reads "usb:VENDOR:PRODUCT[:SERIAL]" (hexadecimal) or "port:BUS-PORT[.PORT...]". CLT_BAD_INPUT for anything else. */
clt_status clt_usb_parse(const char *text, clt_usb_id *which, clt_error *error);
/* Whether the device is one that was asked for. */
bool clt_usb_matches(const clt_usb_id *which, const clt_usb_id *device);
/* The device as a person says it: its serial number where it has one, else its port. */
void clt_usb_describe(const clt_usb_id *device, char *text, size_t size);

/* Waits until such a device is plugged in or, where it is there already, returns at once. CLT_TIMEOUT after timeout_s.
 * Its driver may need some more milliseconds until there is a node. */
clt_status clt_usb_wait(const clt_usb_id *which, double timeout_s, clt_error *error);
/* Resets the device as if it had been plugged out and in, about half a second: every descriptor of it is dead then. All
 * must be closed before. CLT_GONE where it is not there; CLT_FAILED where the user may not, or without libusb. */
clt_status clt_usb_reset(const clt_usb_id *which, clt_error *error);

/* How often a device may be reset: not before `wait` after the last time, which doubles until `longest`. */
typedef struct clt_usb_backoff {
  int64_t next_ns; /* of clt_clock_ns; 0: at once */
  double wait_s;   /* 0: never reset yet */
} clt_usb_backoff;

/* Whether it may be reset at now_ns; where it may, this counts as done. */
bool clt_usb_backoff_take(clt_usb_backoff *backoff, int64_t now_ns);

#endif
