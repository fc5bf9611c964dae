#include <string.h>

#include "camera.h"

#define W16(x) (uint8_t)((x)&255), (uint8_t)((x) >> 8)
#define W32(x) W16((uint32_t)(x)&65535), W16((uint32_t)(x) >> 16)

enum { VENDOR = 0x1d6b, PRODUCT = 0x0104, CONTROL_INTERFACE = 0, STREAM_INTERFACE = 1 };
enum { PROBE = 1, COMMIT = 2, SET_CUR = 0x01, GET_LEN = 0x85, GET_INFO = 0x86 };
enum { GET_STATUS = 0, GET_DESCRIPTOR = 6, GET_CONFIGURATION = 8, SET_CONFIGURATION = 9, GET_INTERFACE = 10 };
enum { DEVICE = 1, CONFIGURATION = 2, STRING = 3, QUALIFIER = 6 };

static const uint8_t device[] = {18,          DEVICE,       W16(0x200),  0xef, 2, 1, 64,
                                 W16(VENDOR), W16(PRODUCT), W16(0x0100), 1,    2, 3, 1};
static const uint8_t qualifier[] = {10, QUALIFIER, W16(0x200), 0xef, 2, 1, 64, 1, 0};

static void put(uvc_stream *stream, const uint8_t *bytes, size_t count) {
  memcpy(stream->configuration + stream->configuration_bytes, bytes, count);
  stream->configuration_bytes += (int)count;
}
#define PUT(stream, ...) put(stream, (const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}))

static void put_length(uvc_stream *stream, int start, int place) {
  int length = stream->configuration_bytes - start;
  stream->configuration[start + place] = (uint8_t)length;
  stream->configuration[start + place + 1] = (uint8_t)(length >> 8);
}

/* A camera terminal (exposure and its mode), a processing unit (the other controls), and the way out over USB. */
static void put_control(uvc_stream *stream) {
  PUT(stream, 8, 11, CONTROL_INTERFACE, 2, 0x0e, 3, 0, 2);
  PUT(stream, 9, 4, CONTROL_INTERFACE, 0, 1, 0x0e, 1, 0, 2);
  int start = stream->configuration_bytes;
  PUT(stream, 13, 0x24, 1, W16(0x100), 0, 0, W32(48000000), 1, STREAM_INTERFACE);
  PUT(stream, 18, 0x24, 2, 1, W16(0x201), 0, 0, 0, 0, 0, 0, 0, 0, 3, 0x0a, 0, 0);
  PUT(stream, 11, 0x24, 5, 2, 1, W16(0), 2, 0x41, 0x16, 0);
  PUT(stream, 9, 0x24, 3, 3, W16(0x101), 0, 2, 0);
  put_length(stream, start, 5);
  PUT(stream, 7, 5, 0x82, 3, W16(16), 8);
  PUT(stream, 5, 0x25, 3, W16(16));
}

/* One format, YUYV, at one size and one rate, over a bulk endpoint. */
static void put_stream(uvc_stream *stream) {
  const camera_options *options = stream->options;
  uint32_t interval = 10000000U / (uint32_t)options->rate_hz;
  uint32_t bits = stream->frame_bytes * 8 * (uint32_t)options->rate_hz;
  PUT(stream, 9, 4, STREAM_INTERFACE, 0, 1, 0x0e, 2, 0, 0);
  int start = stream->configuration_bytes;
  PUT(stream, 14, 0x24, 1, 1, 0, 0, 0x81, 0, 3, 0, 0, 0, 1, 0);
  PUT(stream, 27, 0x24, 4, 1, 1, 'Y', 'U', 'Y', '2', 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71, 16, 1, 0, 0,
      0, 0);
  PUT(stream, 30, 0x24, 5, 1, 0, W16(options->width), W16(options->height), W32(bits), W32(bits),
      W32(stream->frame_bytes), W32(interval), 1, W32(interval));
  PUT(stream, 6, 0x24, 0x0d, 1, 1, 4);
  put_length(stream, start, 4);
  PUT(stream, 7, 5, 0x81, 2, W16(512), 0);
}

static void fill_probe(uvc_stream *stream) {
  const uint8_t head[] = {0, 0, 1, 1, W32(10000000U / (uint32_t)stream->options->rate_hz)};
  const uint8_t tail[] = {W32(stream->frame_bytes), W32(UVC_PAYLOAD)};
  memcpy(stream->probe, head, sizeof head);
  memcpy(stream->probe + 18, tail, sizeof tail);
}

void uvc_init(uvc_stream *stream, const camera_options *options) {
  *stream = (uvc_stream){.options = options};
  stream->frame_bytes = (uint32_t)(2 * options->width * options->height);
  PUT(stream, 9, CONFIGURATION, 0, 0, 2, 1, 0, 0x80, 250);
  put_control(stream);
  put_stream(stream);
  put_length(stream, 0, 2);
  fill_probe(stream);
}

static int answer(const uint8_t *bytes, int count, uint8_t *data, int length) {
  count = length < count ? length : count;
  memcpy(data, bytes, (size_t)count);
  return count;
}

/* 0 is the language, then maker, product and serial number, in UTF-16. */
static int string(const uvc_stream *stream, int index, uint8_t *data, int length) {
  static const uint8_t language[] = {4, STRING, W16(0x0409)};
  const char *texts[] = {"Counterlight", "Simulated camera", stream->options->serial};
  uint8_t out[128] = {0, STRING};
  int count = 2;
  if (index == 0) {
    return answer(language, sizeof language, data, length);
  }
  for (const char *at = index <= 3 ? texts[index - 1] : ""; *at != '\0' && count < 126; at++) {
    out[count] = (uint8_t)*at;
    count += 2;
  }
  out[0] = (uint8_t)count;
  return answer(out, count, data, length);
}

static int descriptor(const uvc_stream *stream, int type, int index, uint8_t *data, int length) {
  switch (type) {
  case DEVICE:
    return answer(device, sizeof device, data, length);
  case CONFIGURATION:
    return answer(stream->configuration, stream->configuration_bytes, data, length);
  case QUALIFIER:
    return answer(qualifier, sizeof qualifier, data, length);
  case STRING:
    return string(stream, index, data, length);
  default:
    return -1;
  }
}

static int standard_request(uvc_stream *stream, const uint8_t setup[8], uint8_t *data, int length) {
  static const uint8_t none[] = {0, 0}, first[] = {1};
  switch (setup[1]) {
  case GET_DESCRIPTOR:
    return descriptor(stream, setup[3], setup[2], data, length);
  case GET_STATUS:
    return answer(none, 2, data, length);
  case GET_CONFIGURATION:
    return answer(first, 1, data, length);
  case GET_INTERFACE:
    return answer(none, 1, data, length);
  case SET_CONFIGURATION:
    stream->configured = true;
    return 0;
  default:
    return 0;
  }
}

/* There is one way to stream: what the host proposes is brought back to it. */
static int negotiate(uvc_stream *stream, uint8_t request, uint8_t *data, int length) {
  static const uint8_t bytes[] = {W16(UVC_PROBE)}, both[] = {3};
  switch (request) {
  case SET_CUR:
    memcpy(stream->probe, data, (size_t)(length < UVC_PROBE ? length : UVC_PROBE));
    fill_probe(stream);
    return 0;
  case GET_LEN:
    return answer(bytes, sizeof bytes, data, length);
  case GET_INFO:
    return answer(both, sizeof both, data, length);
  default:
    return answer(stream->probe, UVC_PROBE, data, length);
  }
}

int uvc_request(uvc_stream *stream, camera_controls *controls, const uint8_t setup[8], uint8_t *data, int length) {
  uint8_t kind = setup[0] & 0x60, selector = setup[3], interface = setup[4], unit = setup[5];
  if (kind == 0) {
    return standard_request(stream, setup, data, length);
  }
  if (kind != 0x20) {
    return -1;
  }
  if (interface == STREAM_INTERFACE && (selector == PROBE || selector == COMMIT)) {
    return negotiate(stream, setup[1], data, length);
  }
  return interface == CONTROL_INTERFACE && unit != 0
             ? controls_request(controls, unit, selector, setup[1], data, length)
             : -1;
}
