/* USB devices without libusb: nothing can be reset, and waiting is only waiting. */
#include <time.h>

#include "device/usb/usb.h"

clt_status clt_usb_wait(const clt_usb_id *which, double timeout_s, clt_error *error) {
  (void)which;
  double seconds = timeout_s < 0.25 ? timeout_s : 0.25;
  nanosleep(&(struct timespec){0, (long)(seconds * 1e9)}, NULL);
  return clt_fail(error, CLT_TIMEOUT, "USB devices are not watched: built without libusb");
}

clt_status clt_usb_reset(const clt_usb_id *which, clt_error *error) {
  char text[192];
  clt_usb_describe(which, text, sizeof text);
  return clt_fail(error, CLT_FAILED, "%s cannot be reset: built without libusb; plug it out and in", text);
}
