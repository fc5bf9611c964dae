/* Pixel formats against closed forms: pictures of random codes are laid out as the kernel's documentation draws each
 * format (here as texts), decoded, and compared with its equations in double precision. */
#include "device/camera/pixels.h"

#include "image/opencv_shim.h"
#include "support.h"

enum { WIDTH = 38, HEIGHT = 22, PIXELS = WIDTH * HEIGHT, PADDING = 12, BYTES_MAX = 8 * (WIDTH + PADDING) * HEIGHT };

static const clt_picture_layout layouts[] = {
    {.matrix = CLT_MATRIX_601, .limited = true},  {.matrix = CLT_MATRIX_601, .limited = false},
    {.matrix = CLT_MATRIX_709, .limited = true},  {.matrix = CLT_MATRIX_709, .limited = false},
    {.matrix = CLT_MATRIX_2020, .limited = true}, {.matrix = CLT_MATRIX_2020, .limited = false},
    {.matrix = CLT_MATRIX_240M, .limited = true}, {.matrix = CLT_MATRIX_240M, .limited = false}};
enum { LAYOUTS = sizeof layouts / sizeof layouts[0] };

static const clt_pixel_format *find(const char *name, bool swapped) {
  const clt_pixel_format *format = clt_pixels_find(clt_pixels_code(name) | (swapped ? 1u << 31 : 0));
  if (format == NULL) {
    fail_msg("%s is not in the table", name);
  }
  return format;
}

static int random_code(uint64_t *random, int bits) {
  double at = test_random(random);
  return at < 0.02 ? 0 : at > 0.98 ? (1 << bits) - 1 : (int)(test_random(random) * (1 << bits));
}

static double clip(double value) {
  return value < 0 ? 0 : value > 1 ? 1 : value;
}

/* R'G'B' 0..1 of Y'CbCr codes: the inverse of Y' = kr R' + kg G' + kb B', Pb = (B' - Y') / (2 - 2 kb),
 * Pr = (R' - Y') / (2 - 2 kr), by Cramer's rule on the forward matrix rather than by its known inverse. */
static void colour_of(const clt_picture_layout *layout, const int code[3], double rgb[3]) {
  static const double weight[4][2] = {{0.299, 0.114}, {0.2126, 0.0722}, {0.2627, 0.0593}, {0.212, 0.087}};
  double kr = weight[layout->matrix][0], kb = weight[layout->matrix][1], kg = 1 - kr - kb;
  double y = layout->limited ? (code[0] - 16) / 219.0 : code[0] / 255.0;
  double pb = (code[1] - 128) / (layout->limited ? 224.0 : 255.0);
  double pr = (code[2] - 128) / (layout->limited ? 224.0 : 255.0);
  double b = 2 * (1 - kb), r = 2 * (1 - kr);
  double m[3][3] = {{kr, kg, kb}, {-kr / b, -kg / b, (1 - kb) / b}, {(1 - kr) / r, -kg / r, -kb / r}};
  double v[3] = {y, pb, pr};
  double det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
               m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  for (int c = 0; c < 3; c++) {
    double a[3][3];
    memcpy(a, m, sizeof a);
    for (int k = 0; k < 3; k++) {
      a[k][c] = v[k];
    }
    rgb[c] = (a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
              a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0])) /
             det;
  }
}

static void decode(const clt_pixel_format *format, const clt_picture_layout *layout, const uint8_t *bytes, size_t used,
                   uint16_t *samples) {
  clt_error error = {0};
  assert_ok(format->decode(format, layout, bytes, used, samples, &error), error);
  if (!format->compressed) {
    size_t last = used - layout->stride;
    assert_int_equal(format->decode(format, layout, bytes, last, samples, &error), CLT_TIMEOUT);
    assert_ok(format->decode(format, layout, bytes, used, samples, &error), error);
  }
}

static void compare(const char *name, const clt_pixel_format *format, const clt_picture_layout *layout, int (*codes)[3],
                    const uint16_t *samples) {
  double full = (1 << format->bits) - 1;
  for (int p = 0; p < PIXELS; p++) {
    double wanted[3];
    if (format->differences) {
      colour_of(layout, codes[p], wanted);
    }
    for (int c = 0; c < 3; c++) {
      double value = format->differences ? wanted[c]
                     : layout->limited   ? (codes[p][c] - 16) / 219.0
                                         : codes[p][c] / 255.0;
      /* Half a code, and what single precision adds to it. */
      if (fabs(samples[3 * p + c] - clip(value) * full) > 0.501) {
        fail_msg("%s, matrix %d%s: pixel %d, channel %d is %d, wanted %.3f", name, layout->matrix,
                 layout->limited ? ", limited" : "", p, c, samples[3 * p + c], clip(value) * full);
      }
    }
  }
}

/* Words as their bits from the highest, one letter a bit (R G B or Y U V; x: nothing), and which byte comes first. */
typedef struct word_case {
  const char *name, *bits;
  bool big_endian, swapped_code;
} word_case;

static const word_case words[] = {
    {"RGB1", "RRRGGGBB", false, false},
    {"R444", "xxxxRRRRGGGGBBBB", false, false},
    {"AR12", "xxxxRRRRGGGGBBBB", false, false},
    {"XR12", "xxxxRRRRGGGGBBBB", false, false},
    {"RA12", "RRRRGGGGBBBBxxxx", false, false},
    {"RX12", "RRRRGGGGBBBBxxxx", false, false},
    {"AB12", "xxxxBBBBGGGGRRRR", false, false},
    {"XB12", "xxxxBBBBGGGGRRRR", false, false},
    {"GA12", "BBBBGGGGRRRRxxxx", false, false},
    {"BX12", "BBBBGGGGRRRRxxxx", false, false},
    {"RGBO", "xRRRRRGGGGGBBBBB", false, false},
    {"AR15", "xRRRRRGGGGGBBBBB", false, false},
    {"XR15", "xRRRRRGGGGGBBBBB", false, false},
    {"RA15", "RRRRRGGGGGBBBBBx", false, false},
    {"RX15", "RRRRRGGGGGBBBBBx", false, false},
    {"AB15", "xBBBBBGGGGGRRRRR", false, false},
    {"XB15", "xBBBBBGGGGGRRRRR", false, false},
    {"BA15", "BBBBBGGGGGRRRRRx", false, false},
    {"BX15", "BBBBBGGGGGRRRRRx", false, false},
    {"RGBP", "RRRRRGGGGGGBBBBB", false, false},
    {"RGBQ", "xRRRRRGGGGGBBBBB", true, false},
    {"AR15", "xRRRRRGGGGGBBBBB", true, true},
    {"XR15", "xRRRRRGGGGGBBBBB", true, true},
    {"RGBR", "RRRRRGGGGGGBBBBB", true, false},
    {"BGRH", "BBBBBBGGGGGGRRRRRRxxxxxxxxxxxxxx", true, false},
    {"Y444", "xxxxYYYYUUUUVVVV", false, false},
    {"YUVO", "xYYYYYUUUUUVVVVV", false, false},
    {"YUVP", "YYYYYUUUUUUVVVVV", false, false},
    /* Bytes in the order in which they lie. */
    {"RGB3", "RRRRRRRRGGGGGGGGBBBBBBBB", true, false},
    {"BGR3", "BBBBBBBBGGGGGGGGRRRRRRRR", true, false},
    {"BGR4", "BBBBBBBBGGGGGGGGRRRRRRRRxxxxxxxx", true, false},
    {"AR24", "BBBBBBBBGGGGGGGGRRRRRRRRxxxxxxxx", true, false},
    {"XR24", "BBBBBBBBGGGGGGGGRRRRRRRRxxxxxxxx", true, false},
    {"RA24", "xxxxxxxxBBBBBBBBGGGGGGGGRRRRRRRR", true, false},
    {"RX24", "xxxxxxxxBBBBBBBBGGGGGGGGRRRRRRRR", true, false},
    {"RGB4", "xxxxxxxxRRRRRRRRGGGGGGGGBBBBBBBB", true, false},
    {"BA24", "xxxxxxxxRRRRRRRRGGGGGGGGBBBBBBBB", true, false},
    {"BX24", "xxxxxxxxRRRRRRRRGGGGGGGGBBBBBBBB", true, false},
    {"AB24", "RRRRRRRRGGGGGGGGBBBBBBBBxxxxxxxx", true, false},
    {"XB24", "RRRRRRRRGGGGGGGGBBBBBBBBxxxxxxxx", true, false},
    {"YUV3", "YYYYYYYYUUUUUUUUVVVVVVVV", true, false},
    {"YUV4", "xxxxxxxxYYYYYYYYUUUUUUUUVVVVVVVV", true, false},
    {"AYUV", "xxxxxxxxYYYYYYYYUUUUUUUUVVVVVVVV", true, false},
    {"XYUV", "xxxxxxxxYYYYYYYYUUUUUUUUVVVVVVVV", true, false},
    {"VUYA", "VVVVVVVVUUUUUUUUYYYYYYYYxxxxxxxx", true, false},
    {"VUYX", "VVVVVVVVUUUUUUUUYYYYYYYYxxxxxxxx", true, false},
    {"YUVA", "YYYYYYYYUUUUUUUUVVVVVVVVxxxxxxxx", true, false},
    {"YUVX", "YYYYYYYYUUUUUUUUVVVVVVVVxxxxxxxx", true, false},
};

/* Writes one pixel and returns, as codes of 8 bits, what it then holds. */
static void write_word(const word_case *word, uint64_t *random, uint8_t *to, int code[3]) {
  int total = (int)strlen(word->bits), bits[3] = {0};
  for (int k = 0; k < total; k++) {
    const char *letter = strchr("RYGUBV", word->bits[k]);
    if (letter != NULL) {
      bits[(letter - "RYGUBV") / 2]++;
    }
  }
  int value[3], left[3];
  for (int c = 0; c < 3; c++) {
    value[c] = random_code(random, bits[c]);
    left[c] = bits[c];
    bool difference = strchr(word->bits, 'Y') != NULL;
    code[c] = difference ? value[c] << (8 - bits[c]) : (int)lround(value[c] * 255.0 / ((1 << bits[c]) - 1));
  }
  memset(to, 0, (size_t)total / 8);
  for (int k = 0; k < total; k++) {
    const char *letter = strchr("RYGUBV", word->bits[k]);
    int c = letter != NULL ? (int)(letter - "RYGUBV") / 2 : -1;
    int bit = c >= 0 ? value[c] >> --left[c] & 1 : test_random(random) < 0.5;
    int at = word->big_endian ? k / 8 : total / 8 - 1 - k / 8;
    to[at] = (uint8_t)(to[at] | bit << (7 - k % 8));
  }
}

static void words_are_read(void **state) {
  (void)state;
  static uint8_t bytes[BYTES_MAX];
  static uint16_t samples[3 * PIXELS];
  static int codes[PIXELS][3];
  uint64_t random = 20;
  for (size_t w = 0; w < sizeof words / sizeof words[0]; w++) {
    const clt_pixel_format *format = find(words[w].name, words[w].swapped_code);
    size_t step = strlen(words[w].bits) / 8;
    for (int l = 0; l < LAYOUTS; l++) {
      clt_picture_layout layout = layouts[l];
      layout.width = WIDTH;
      layout.height = HEIGHT;
      layout.stride = step * WIDTH + PADDING;
      for (int p = 0; p < PIXELS; p++) {
        size_t at = (size_t)(p / WIDTH) * layout.stride + (size_t)(p % WIDTH) * step;
        write_word(&words[w], &random, bytes + at, codes[p]);
      }
      decode(format, &layout, bytes, layout.stride * HEIGHT, samples);
      compare(words[w].name, format, &layout, codes, samples);
    }
  }
}

/* Brightness for every pixel, colour differences for groups of across x down pixels. */
static void random_planes(uint64_t *random, int across, int down, int (*codes)[3]) {
  for (int y = 0; y < HEIGHT; y++) {
    for (int x = 0; x < WIDTH; x++) {
      int *code = codes[y * WIDTH + x], *first = codes[y / down * down * WIDTH + x / across * across];
      code[0] = random_code(random, 8);
      code[1] = code == first ? random_code(random, 8) : first[1];
      code[2] = code == first ? random_code(random, 8) : first[2];
    }
  }
}

static void pairs_are_read(void **state) {
  (void)state;
  static const char *const names[] = {"YUYV", "UYVY", "YVYU", "VYUY"};
  static uint8_t bytes[BYTES_MAX];
  static uint16_t samples[3 * PIXELS];
  static int codes[PIXELS][3];
  uint64_t random = 21;
  for (int n = 0; n < 4; n++) {
    for (int l = 0; l < LAYOUTS; l++) {
      clt_picture_layout layout = layouts[l];
      layout.width = WIDTH;
      layout.height = HEIGHT;
      layout.stride = 2 * WIDTH + PADDING;
      random_planes(&random, 2, 1, codes);
      for (int p = 0; p < PIXELS; p += 2) {
        uint8_t *to = bytes + (size_t)(p / WIDTH) * layout.stride + (size_t)(p % WIDTH) * 2;
        int light = 0;
        for (int k = 0; k < 4; k++) {
          to[k] = (uint8_t)(names[n][k] == 'Y'   ? codes[p + light++][0]
                            : names[n][k] == 'U' ? codes[p][1]
                                                 : codes[p][2]);
        }
      }
      decode(find(names[n], false), &layout, bytes, layout.stride * HEIGHT, samples);
      compare(names[n], find(names[n], false), &layout, codes, samples);
    }
  }
}

typedef struct plane_case {
  const char *name, *order; /* of the colour differences: "UV", "VU"; "U,V": each in a plane */
  int across, down;
} plane_case;
static const plane_case planes[] = {{"NV12", "UV", 2, 2},  {"NV21", "VU", 2, 2},  {"NV16", "UV", 2, 1},
                                    {"NV61", "VU", 2, 1},  {"NV24", "UV", 1, 1},  {"NV42", "VU", 1, 1},
                                    {"YU12", "U,V", 2, 2}, {"YV12", "V,U", 2, 2}, {"422P", "U,V", 2, 1}};

/* Returns the bytes of the whole picture. */
static size_t write_planes(const plane_case *plane, size_t stride, int (*codes)[3], uint8_t *bytes) {
  for (int p = 0; p < PIXELS; p++) {
    bytes[(size_t)(p / WIDTH) * stride + (size_t)(p % WIDTH)] = (uint8_t)codes[p][0];
  }
  uint8_t *chroma = bytes + stride * HEIGHT;
  bool together = strlen(plane->order) == 2;
  size_t row = stride * (together ? 2 : 1) / (size_t)plane->across, rows = HEIGHT / (size_t)plane->down;
  for (int y = 0; y < HEIGHT; y += plane->down) {
    for (int x = 0; x < WIDTH; x += plane->across) {
      size_t at = (size_t)(y / plane->down) * row, column = (size_t)(x / plane->across);
      for (int k = 0; k < 2; k++) {
        int code = codes[y * WIDTH + x][plane->order[together ? k : 2 * k] == 'U' ? 1 : 2];
        chroma[together ? at + 2 * column + (size_t)k : at + column + (size_t)k * row * rows] = (uint8_t)code;
      }
    }
  }
  return stride * HEIGHT + row * rows * (together ? 1 : 2);
}

static void planes_are_read(void **state) {
  (void)state;
  static uint8_t bytes[BYTES_MAX];
  static uint16_t samples[3 * PIXELS];
  static int codes[PIXELS][3];
  uint64_t random = 22;
  for (size_t n = 0; n < sizeof planes / sizeof planes[0]; n++) {
    for (int l = 0; l < LAYOUTS; l++) {
      clt_picture_layout layout = layouts[l];
      layout.width = WIDTH;
      layout.height = HEIGHT;
      layout.stride = WIDTH + PADDING;
      random_planes(&random, planes[n].across, planes[n].down, codes);
      size_t size = write_planes(&planes[n], layout.stride, codes, bytes);
      decode(find(planes[n].name, false), &layout, bytes, size, samples);
      compare(planes[n].name, find(planes[n].name, false), &layout, codes, samples);
    }
  }
}

static void grey_is_read(void **state) {
  (void)state;
  static const struct {
    const char *name;
    int bits;
    bool swapped;
  } cases[] = {{"GREY", 8, false}, {"Y10 ", 10, false}, {"Y12 ", 12, false}, {"Y16 ", 16, false}, {"Y16 ", 16, true}};
  static uint8_t bytes[BYTES_MAX];
  static uint16_t samples[PIXELS];
  uint64_t random = 23;
  for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
    const clt_pixel_format *format = find(cases[n].name, cases[n].swapped);
    size_t step = cases[n].bits > 8 ? 2 : 1;
    clt_picture_layout layout = {.width = WIDTH, .height = HEIGHT, .stride = step * WIDTH + PADDING, .limited = true};
    int codes[PIXELS];
    for (int p = 0; p < PIXELS; p++) {
      uint8_t *to = bytes + (size_t)(p / WIDTH) * layout.stride + (size_t)(p % WIDTH) * step;
      codes[p] = random_code(&random, cases[n].bits);
      to[cases[n].swapped ? 1 : 0] = (uint8_t)codes[p];
      if (step == 2) {
        to[cases[n].swapped ? 0 : 1] = (uint8_t)(codes[p] >> 8);
      }
    }
    assert_int_equal(format->bits, cases[n].bits);
    assert_int_equal(format->channels, 1);
    decode(format, &layout, bytes, layout.stride * HEIGHT, samples);
    for (int p = 0; p < PIXELS; p++) {
      assert_int_equal(samples[p], codes[p]);
    }
  }
}

/* The kernel's drawing of the first two rows: letters of the pixels from left to right, first row then second. */
typedef struct mosaic_case {
  const char *name, *square;
  int bits;
} mosaic_case;
static const mosaic_case mosaics[] = {
    {"BA81", "BGGR", 8},  {"GBRG", "GBRG", 8},  {"GRBG", "GRBG", 8},  {"RGGB", "RGGB", 8},
    {"BG10", "BGGR", 10}, {"GB10", "GBRG", 10}, {"BA10", "GRBG", 10}, {"RG10", "RGGB", 10},
    {"BG12", "BGGR", 12}, {"GB12", "GBRG", 12}, {"BA12", "GRBG", 12}, {"RG12", "RGGB", 12},
    {"BYR2", "BGGR", 16}, {"GB16", "GBRG", 16}, {"GR16", "GRBG", 16}, {"RG16", "RGGB", 16}};

static void mosaics_are_read(void **state) {
  (void)state;
  static uint8_t bytes[BYTES_MAX];
  static uint16_t samples[3 * PIXELS];
  uint64_t random = 24;
  for (size_t n = 0; n < sizeof mosaics / sizeof mosaics[0]; n++) {
    const clt_pixel_format *format = find(mosaics[n].name, false);
    size_t step = mosaics[n].bits > 8 ? 2 : 1;
    clt_picture_layout layout = {.width = WIDTH, .height = HEIGHT, .stride = step * WIDTH + PADDING};
    double sum[PIXELS / 4][3] = {{0}};
    for (int p = 0; p < PIXELS; p++) {
      int x = p % WIDTH, y = p / WIDTH, code = random_code(&random, mosaics[n].bits);
      char letter = mosaics[n].square[y % 2 * 2 + x % 2];
      uint8_t *to = bytes + (size_t)y * layout.stride + (size_t)x * step;
      to[0] = (uint8_t)code;
      if (step == 2) {
        to[1] = (uint8_t)(code >> 8);
      }
      sum[y / 2 * (WIDTH / 2) + x / 2][letter == 'R' ? 0 : letter == 'G' ? 1 : 2] += letter == 'G' ? code / 2.0 : code;
    }
    decode(format, &layout, bytes, layout.stride * HEIGHT, samples);
    double factor = ((1 << format->bits) - 1.0) / ((1 << mosaics[n].bits) - 1.0);
    assert_int_equal(format->bits, mosaics[n].bits == 16 ? 16 : mosaics[n].bits + 2);
    for (int p = 0; p < PIXELS / 4; p++) {
      for (int c = 0; c < 3; c++) {
        assert_near(samples[3 * p + c], sum[p][c] * factor, 0.5);
      }
    }
  }
}

/* Bytes without the segments of one marker: Motion JPEG leaves the Huffman tables out. */
static size_t without_segments(const uint8_t *from, size_t size, uint8_t marker, uint8_t *to) {
  size_t at = 2, used = 2;
  memcpy(to, from, 2);
  while (at + 4 <= size && from[at] == 0xff && from[at + 1] != 0xda) {
    size_t length = 2 + ((size_t)from[at + 2] << 8 | from[at + 3]);
    if (from[at + 1] != marker) {
      memcpy(to + used, from + at, length);
      used += length;
    }
    at += length;
  }
  memcpy(to + used, from + at, size - at);
  return used + size - at;
}

static void jpeg_is_read(void **state) {
  (void)state;
  uint8_t picture[PIXELS * 3];
  static uint8_t bare[BYTES_MAX];
  static uint16_t samples[3 * PIXELS];
  unsigned char *bytes = NULL;
  size_t size = 0;
  clt_error error = {0};
  for (int p = 0; p < PIXELS; p++) {
    picture[3 * p] = (uint8_t)(40 + 4 * (p % WIDTH));
    picture[3 * p + 1] = (uint8_t)(60 + 5 * (p / WIDTH));
    picture[3 * p + 2] = (uint8_t)(200 - 3 * (p % WIDTH));
  }
  clt_raster raster = {WIDTH, HEIGHT, 3, 8, picture};
  assert_ok(clt_opencv_encode("picture", ".jpg", &raster, &bytes, &size, &error), error);
  size_t used = without_segments(bytes, size, 0xc4, bare);
  assert_true(used < size);
  memset(bare + used, 0, 7); /* what a driver's buffer holds behind the picture */
  const clt_pixel_format *format = find("MJPG", false);
  clt_picture_layout layout = {.width = WIDTH, .height = HEIGHT};
  decode(format, &layout, bare, used + 7, samples);
  double square = 0;
  for (int k = 0; k < 3 * PIXELS; k++) {
    square += pow(samples[k] - picture[k], 2);
  }
  assert_true(sqrt(square / (3 * PIXELS)) < 2.5);
  assert_int_equal(format->decode(format, &layout, bare, used / 2, samples, &error), CLT_TIMEOUT);
  assert_int_equal(error.status, CLT_TIMEOUT);
  bare[0] = 0;
  assert_int_equal(format->decode(format, &layout, bare, used, samples, &error), CLT_TIMEOUT);
  layout.width = WIDTH - 2;
  assert_int_equal(format->decode(format, &layout, bytes, size, samples, &error), CLT_TIMEOUT);
  free(bytes);
}

/* Codes of Y'CbCr before rounding. */
static void codes_of(const clt_picture_layout *layout, const double rgb[3], double code[3]) {
  static const double weight[4][2] = {{0.299, 0.114}, {0.2126, 0.0722}, {0.2627, 0.0593}, {0.212, 0.087}};
  double kr = weight[layout->matrix][0], kb = weight[layout->matrix][1];
  double y = kr * rgb[0] + (1 - kr - kb) * rgb[1] + kb * rgb[2], range = layout->limited ? 224 : 255;
  code[0] = layout->limited ? 16 + 219 * y : 255 * y;
  code[1] = 128 + range * (rgb[2] - y) / (2 - 2 * kb);
  code[2] = 128 + range * (rgb[0] - y) / (2 - 2 * kr);
}

/* Half a step is as far as rounding moves any channel, and random colours come near it. */
static void steps_are_twice_what_rounding_moves(void **state) {
  (void)state;
  uint64_t random = 11;
  for (int k = 0; k < LAYOUTS; k++) {
    double half = 0.5 * clt_pixels_step(find("YUYV", false), &layouts[k]) / 1023, worst = 0;
    for (int n = 0; n < 20000; n++) {
      double rgb[3], exact[3], back[3];
      for (int c = 0; c < 3; c++) {
        rgb[c] = test_random(&random);
      }
      codes_of(&layouts[k], rgb, exact);
      const int code[3] = {(int)lrint(exact[0]), (int)lrint(exact[1]), (int)lrint(exact[2])};
      colour_of(&layouts[k], code, back);
      for (int c = 0; c < 3; c++) {
        worst = fmax(worst, fabs(back[c] - rgb[c]));
      }
    }
    assert_true(worst <= half * 1.0001 && worst > 0.9 * half);
  }
  assert_near(clt_pixels_step(find("GREY", false), &layouts[0]), 1, 0);
  assert_near(clt_pixels_step(find("RGB3", false), &layouts[1]), 1, 0);
  assert_near(clt_pixels_step(find("RGB3", false), &layouts[0]), 255.0 / 219, 1e-12);
  assert_near(clt_pixels_step(find("RGGB", false), &layouts[1]), 1023.0 / 255, 1e-12);
  assert_near(clt_pixels_step(find("MJPG", false), &layouts[0]), 1 + 1.772, 1e-6);
}

/* No code stands twice in the table, and every entry is one that the tests above name. */
static void table_is_tested(void **state) {
  (void)state;
  const clt_pixel_format *format;
  size_t count = 0, tested = sizeof words / sizeof words[0] + 4 + sizeof planes / sizeof planes[0] + 5 +
                             sizeof mosaics / sizeof mosaics[0] + 2;
  for (; (format = clt_pixels_at(count)) != NULL; count++) {
    assert_ptr_equal(clt_pixels_find(format->code), format);
  }
  assert_int_equal(count, tested);
  assert_null(clt_pixels_find(clt_pixels_code("HSV3")));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(words_are_read),
      cmocka_unit_test(pairs_are_read),
      cmocka_unit_test(planes_are_read),
      cmocka_unit_test(grey_is_read),
      cmocka_unit_test(mosaics_are_read),
      cmocka_unit_test(jpeg_is_read),
      cmocka_unit_test(steps_are_twice_what_rounding_moves),
      cmocka_unit_test(table_is_tested),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
