/* USB devices through libusb. Every call has a context of its own, so that nothing is left between calls. */
#include "device/usb/usb.h"

#include <libusb.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"

static void read_port(libusb_device *device, char *text, size_t size) {
  uint8_t ports[8];
  int depth = libusb_get_port_numbers(device, ports, sizeof ports);
  int used = snprintf(text, size, "%d", libusb_get_bus_number(device));
  for (int k = 0; k < depth; k++) {
    used += snprintf(text + used, size - (size_t)used, "%c%d", k == 0 ? '-' : '.', ports[k]);
  }
}

/* Serial numbers need an open device: read only where one is asked for and all the rest fits. */
static bool fits(libusb_device *device, const clt_usb_id *which) {
  struct libusb_device_descriptor about;
  clt_usb_id found = {0}, rest = *which;
  libusb_device_handle *handle = NULL;
  if (libusb_get_device_descriptor(device, &about) != 0) {
    return false;
  }
  found.vendor = about.idVendor;
  found.product = about.idProduct;
  read_port(device, found.port, sizeof found.port);
  rest.serial[0] = '\0';
  if (!clt_usb_matches(&rest, &found) || which->serial[0] == '\0') {
    return clt_usb_matches(which, &found);
  }
  if (about.iSerialNumber == 0 || libusb_open(device, &handle) != 0) {
    return false;
  }
  int length = libusb_get_string_descriptor_ascii(handle, about.iSerialNumber, (unsigned char *)found.serial,
                                                  sizeof found.serial - 1);
  found.serial[length > 0 ? length : 0] = '\0';
  libusb_close(handle);
  return clt_usb_matches(which, &found);
}

static clt_status fail(const clt_usb_id *which, const char *doing, int code, clt_error *error) {
  char text[192];
  clt_usb_describe(which, text, sizeof text);
  bool gone = code == LIBUSB_ERROR_NO_DEVICE || code == LIBUSB_ERROR_NOT_FOUND;
  return clt_fail(error, gone ? CLT_GONE : CLT_FAILED, "%s: %s: %s%s", text, doing, libusb_strerror(code),
                  code == LIBUSB_ERROR_ACCESS ? "; give the service's group write access to it by a udev rule"
                  : gone                      ? "; plug it in again"
                                              : "; plug it out and in");
}

static clt_status begin(const clt_usb_id *which, libusb_context **context, clt_error *error) {
  int code = libusb_init(context);
  return code == 0 ? CLT_OK : fail(which, "starting libusb", code, error);
}

/* A reference to the device; NULL where it is not there. */
static libusb_device *find(libusb_context *context, const clt_usb_id *which) {
  libusb_device **list = NULL, *found = NULL;
  ssize_t count = libusb_get_device_list(context, &list);
  for (ssize_t k = 0; k < count && found == NULL; k++) {
    found = fits(list[k], which) ? libusb_ref_device(list[k]) : NULL;
  }
  if (count >= 0) {
    libusb_free_device_list(list, 1);
  }
  return found;
}

static clt_status reset(libusb_context *context, const clt_usb_id *which, clt_error *error) {
  libusb_device_handle *handle = NULL;
  libusb_device *device = find(context, which);
  if (device == NULL) {
    return fail(which, "resetting it", LIBUSB_ERROR_NO_DEVICE, error);
  }
  int code = libusb_open(device, &handle);
  if (code == 0) {
    /* Where it comes back as another device libusb says so, and that is as good. */
    code = libusb_reset_device(handle);
    code = code == LIBUSB_ERROR_NOT_FOUND ? 0 : code;
    libusb_close(handle);
  }
  libusb_unref_device(device);
  return code == 0 ? CLT_OK : fail(which, "resetting it", code, error);
}

clt_status clt_usb_reset(const clt_usb_id *which, clt_error *error) {
  libusb_context *context = NULL;
  clt_status status = begin(which, &context, error);
  if (status == CLT_OK) {
    status = reset(context, which, error);
    libusb_exit(context);
  }
  return status;
}

static int LIBUSB_CALL arrived(libusb_context *context, libusb_device *device, libusb_hotplug_event event, void *flag) {
  (void)context;
  (void)device;
  (void)event;
  *(int *)flag = 1;
  return 0;
}

/* Looks after every arrival, and once in between where no arrivals are told. Told by one registration for all the wait:
 * the end of one wakes whoever waits next, who would never wait again. */
static clt_status wait_in(libusb_context *context, const clt_usb_id *which, double timeout_s, clt_error *error) {
  int64_t start = clt_clock_ns();
  int news = 0;
  libusb_device *device;
  libusb_hotplug_callback_handle handle = 0;
  int code = libusb_hotplug_register_callback(context, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED, LIBUSB_HOTPLUG_NO_FLAGS,
                                              LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
                                              LIBUSB_HOTPLUG_MATCH_ANY, arrived, &news, &handle);
  double left = timeout_s;
  while ((device = find(context, which)) == NULL && (left = timeout_s - clt_clock_since(start)) > 0) {
    struct timeval slice = {0, left < 0.25 ? (int)(left * 1e6) + 1 : 250000};
    news = 0;
    libusb_handle_events_timeout_completed(context, &slice, &news);
  }
  if (code == 0) {
    libusb_hotplug_deregister_callback(context, handle);
  }
  if (device == NULL) {
    char text[192];
    clt_usb_describe(which, text, sizeof text);
    return clt_fail(error, CLT_TIMEOUT, "%s was not plugged in within %.3g s", text, timeout_s);
  }
  libusb_unref_device(device);
  return CLT_OK;
}

clt_status clt_usb_wait(const clt_usb_id *which, double timeout_s, clt_error *error) {
  libusb_context *context = NULL;
  clt_status status = begin(which, &context, error);
  if (status == CLT_OK) {
    status = wait_in(context, which, timeout_s, error);
    libusb_exit(context);
  }
  return status;
}
