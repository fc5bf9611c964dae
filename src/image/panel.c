#include "counterlight/panel.h"

#include <math.h>
#include <string.h>

enum { N = CLT_PANEL_CHANNELS };

clt_panel clt_panel_of_curve(const clt_curve *response) {
  return (clt_panel){.response = {*response, *response, *response}};
}

/* Cofactors over the determinant; false where that is too near 0 for rows that sum to 1. */
static bool invert(double m[N][N], double inverse[N][N]) {
  const double least = 0.02;
  double determinant = 0;
  for (int i = 0; i < N; i++) {
    for (int j = 0; j < N; j++) {
      int a = (j + 1) % N, b = (j + 2) % N, c = (i + 1) % N, d = (i + 2) % N;
      inverse[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
    }
    determinant += m[0][i] * inverse[i][0];
  }
  for (int i = 0; i < N; i++) {
    for (int j = 0; j < N; j++) {
      inverse[i][j] /= determinant;
    }
  }
  return fabs(determinant) >= least;
}

clt_status clt_panel_set_crosstalk(clt_panel *panel, const double light[N * N], clt_error *error) {
  for (int c = 0; c < N; c++) {
    const double *from = light + (size_t)N * (size_t)c;
    double row = from[0] + from[1] + from[2];
    for (int k = 0; k < N; k++) {
      panel->crosstalk[c][k] = from[k] / row;
    }
    if (!(row > 0) || !isfinite(row)) {
      return clt_fail(error, CLT_BAD_INPUT, "the panel gives no light in channel %d; look at its cable and settings",
                      c);
    }
  }
  panel->mixes = invert(panel->crosstalk, panel->unmix);
  if (!panel->mixes) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the panel's channels look alike to the camera (crosstalk rows %.2g %.2g %.2g, %.2g %.2g %.2g, "
                    "%.2g %.2g %.2g); is one of the two set to grey?",
                    panel->crosstalk[0][0], panel->crosstalk[0][1], panel->crosstalk[0][2], panel->crosstalk[1][0],
                    panel->crosstalk[1][1], panel->crosstalk[1][2], panel->crosstalk[2][0], panel->crosstalk[2][1],
                    panel->crosstalk[2][2]);
  }
  return CLT_OK;
}

/* Codes of one cell. */
static void encode_cell(const clt_panel *panel, int channels, const double light[N], float code[N]) {
  for (int k = 0; k < channels; k++) {
    const double *row = panel->unmix[k];
    double own = panel->mixes && channels == N ? row[0] * light[0] + row[1] * light[1] + row[2] * light[2] : light[k];
    code[k] = (float)clt_curve_encode(&panel->response[k], own);
  }
}

/* First pixel of a side that belongs to a cell: pixel p lies in cell p * cells / pixels. */
static int first_pixel(int cell, int cells, int pixels) {
  return (int)(((long)cell * pixels + cells - 1) / cells);
}

/* The codes of one row of cells, for the first row of pixels that shows it. */
static void encode_row(const clt_panel *panel, const clt_image *drive, int row, int channels, int width, size_t plane,
                       float *codes) {
  size_t cells = (size_t)drive->width * (size_t)drive->height;
  for (int x = 0; x < drive->width; x++) {
    double light[N];
    float code[N];
    for (int c = 0; c < channels; c++) {
      size_t from = c < drive->channels ? (size_t)c : 0;
      light[c] = drive->data[from * cells + (size_t)row * (size_t)drive->width + (size_t)x];
    }
    encode_cell(panel, channels, light, code);
    int end = first_pixel(x + 1, drive->width, width);
    for (int p = first_pixel(x, drive->width, width); p < end; p++) {
      for (int c = 0; c < channels; c++) {
        codes[(size_t)c * plane + (size_t)p] = code[c];
      }
    }
  }
}

void clt_panel_encode(const clt_panel *panel, const clt_image *drive, int channels, int height, int width,
                      float *codes) {
  size_t plane = (size_t)width * (size_t)height;
  for (int row = 0; row < drive->height; row++) {
    int first = first_pixel(row, drive->height, height), end = first_pixel(row + 1, drive->height, height);
    if (first == end) {
      continue;
    }
    float *top = codes + (size_t)first * (size_t)width;
    encode_row(panel, drive, row, channels, width, plane, top);
    for (int c = 0; c < channels; c++) {
      for (int y = 1; y < end - first; y++) {
        float *line = top + (size_t)c * plane;
        memcpy(line + (size_t)y * (size_t)width, line, (size_t)width * sizeof *line);
      }
    }
  }
}

clt_status clt_panel_decode(const clt_panel *panel, const clt_image *codes, clt_image *light, clt_error *error) {
  clt_status status = clt_image_init(light, codes->channels, codes->height, codes->width, error);
  if (status != CLT_OK) {
    return status;
  }
  size_t plane = (size_t)codes->width * (size_t)codes->height;
  bool mixes = panel->mixes && codes->channels == N;
  for (size_t i = 0; i < plane; i++) {
    double own[N];
    for (int k = 0; k < codes->channels && k < N; k++) {
      own[k] = clt_curve_decode(&panel->response[k], codes->data[(size_t)k * plane + i]);
    }
    for (int c = 0; c < codes->channels && c < N; c++) {
      const double *row = panel->crosstalk[c];
      light->data[(size_t)c * plane + i] =
          (float)(mixes ? row[0] * own[0] + row[1] * own[1] + row[2] * own[2] : own[c]);
    }
  }
  return CLT_OK;
}

clt_status clt_panel_shown(const clt_panel *panel, int bits, const clt_image *drive, clt_image *shown,
                           clt_error *error) {
  const float top = (float)((1 << bits) - 1);
  clt_image codes = {0};
  clt_status status = clt_image_init(&codes, drive->channels, drive->height, drive->width, error);
  if (status == CLT_OK) {
    clt_panel_encode(panel, drive, drive->channels, drive->height, drive->width, codes.data);
    for (size_t i = 0; i < clt_image_size(&codes); i++) {
      codes.data[i] = roundf(codes.data[i] * top) / top;
    }
    status = clt_panel_decode(panel, &codes, shown, error);
  }
  clt_image_finish(&codes);
  return status;
}

clt_status clt_panel_write(const char *path, const clt_panel *panel, const clt_image *drive, clt_error *error) {
  static const clt_curve as_it_is = {.kind = CLT_CURVE_LINEAR};
  if (clt_image_path_is_linear(path)) {
    return clt_image_write(path, NULL, drive, error);
  }
  clt_image codes = {0};
  clt_status status = clt_image_init(&codes, drive->channels, drive->height, drive->width, error);
  if (status == CLT_OK) {
    clt_panel_encode(panel, drive, drive->channels, drive->height, drive->width, codes.data);
    status = clt_image_write(path, &as_it_is, &codes, error);
  }
  clt_image_finish(&codes);
  return status;
}
