/* Telling USB devices apart. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "device/usb/usb.h"

#define LONGEST_WAIT_S 64.0

static bool is_port(const char *text) {
  return strspn(text, "0123456789-.") == strlen(text) && isdigit((unsigned char)text[0]) && strchr(text, '-') != NULL;
}

static clt_status parse_usb(const char *text, clt_usb_id *which, clt_error *error) {
  unsigned vendor = 0, product = 0;
  int used = 0;
  if (sscanf(text, "usb:%4x:%4x%n", &vendor, &product, &used) == 2 && (text[used] == '\0' || text[used] == ':')) {
    const char *serial = text[used] == ':' ? text + used + 1 : "";
    if (strlen(serial) < sizeof which->serial) {
      which->vendor = (int)vendor;
      which->product = (int)product;
      strcpy(which->serial, serial);
      return CLT_OK;
    }
  }
  return clt_fail(error, CLT_BAD_INPUT,
                  "\"%s\" does not name a USB device; write \"usb:VENDOR:PRODUCT\" or "
                  "\"usb:VENDOR:PRODUCT:SERIAL\", the numbers in hexadecimal",
                  text);
}

clt_status clt_usb_parse(const char *text, clt_usb_id *which, clt_error *error) {
  *which = (clt_usb_id){.vendor = -1, .product = -1};
  if (strncmp(text, "port:", 5) != 0) {
    return parse_usb(text, which, error);
  }
  if (!is_port(text + 5) || strlen(text + 5) >= sizeof which->port) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "\"%s\" does not name a USB port; write \"port:BUS-PORT\" or "
                    "\"port:BUS-PORT.PORT\", as in /sys/bus/usb/devices",
                    text);
  }
  strcpy(which->port, text + 5);
  return CLT_OK;
}

bool clt_usb_matches(const clt_usb_id *which, const clt_usb_id *device) {
  return (which->vendor < 0 || which->vendor == device->vendor) &&
         (which->product < 0 || which->product == device->product) &&
         (which->serial[0] == '\0' || strcmp(which->serial, device->serial) == 0) &&
         (which->port[0] == '\0' || strcmp(which->port, device->port) == 0);
}

void clt_usb_describe(const clt_usb_id *device, char *text, size_t size) {
  if (device->vendor < 0) {
    snprintf(text, size, "port:%s", device->port);
    return;
  }
  snprintf(text, size, "usb:%04x:%04x%s%s", device->vendor, device->product, device->serial[0] != '\0' ? ":" : "",
           device->serial[0] != '\0' ? device->serial : "");
}

bool clt_usb_backoff_take(clt_usb_backoff *backoff, int64_t now_ns) {
  if (now_ns < backoff->next_ns) {
    return false;
  }
  backoff->wait_s = backoff->wait_s == 0                   ? 1
                    : backoff->wait_s < LONGEST_WAIT_S / 2 ? 2 * backoff->wait_s
                                                           : LONGEST_WAIT_S;
  backoff->next_ns = now_ns + (int64_t)(backoff->wait_s * 1e9);
  return true;
}
