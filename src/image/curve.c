#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "counterlight/image.h"
#include "image/pchip.h"

/* Where the two pieces of the sRGB curve meet, 12.92 l = 1.055 l^(1/2.4) - 0.055. IEC 61966-2-1 rounds these to 0.04045
 * and 0.0031308, which leaves a step down of 3e-8 in the curve; at the intersection it is continuous and monotone. */
static const double srgb_joint_code = 0.0404482362771082;
static const double srgb_joint_light = 0.0404482362771082 / 12.92;

static const double gamma_least = 0.2, gamma_most = 5.0;

static clt_status parse_gamma(const char *text, clt_curve *curve, clt_error *error) {
  char *end = NULL;
  double gamma = strtod(text + strlen("gamma "), &end);
  if (end == text + strlen("gamma ") || *end != '\0' || !(gamma >= gamma_least && gamma <= gamma_most)) {
    return clt_fail(error, CLT_BAD_INPUT, "response curve \"%.60s\": gamma takes a number from %g to %g", text,
                    gamma_least, gamma_most);
  }
  *curve = (clt_curve){.kind = CLT_CURVE_GAMMA, .gamma = gamma};
  return CLT_OK;
}

clt_status clt_curve_parse(const char *text, clt_curve *curve, clt_error *error) {
  if (strcmp(text, "linear") == 0) {
    *curve = (clt_curve){.kind = CLT_CURVE_LINEAR};
    return CLT_OK;
  }
  if (strcmp(text, "srgb") == 0) {
    *curve = (clt_curve){.kind = CLT_CURVE_SRGB};
    return CLT_OK;
  }
  if (strncmp(text, "gamma ", 6) == 0 || strncmp(text, "gamma:", 6) == 0) {
    return parse_gamma(text, curve, error);
  }
  if (strcmp(text, "table") == 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "response curve \"table\" was measured, and its values are in the rig's calibration only; use it "
                    "through that rig");
  }
  return clt_fail(error, CLT_BAD_INPUT, "response curve \"%.60s\": give \"linear\", \"srgb\" or \"gamma 2.2\"", text);
}

void clt_curve_format(const clt_curve *curve, char *text, size_t size) {
  switch (curve->kind) {
  case CLT_CURVE_LINEAR:
    snprintf(text, size, "linear");
    break;
  case CLT_CURVE_SRGB:
    snprintf(text, size, "srgb");
    break;
  case CLT_CURVE_GAMMA:
    snprintf(text, size, "gamma %.15g", curve->gamma);
    break;
  case CLT_CURVE_TABLE:
    snprintf(text, size, "table");
    break;
  }
}

clt_status clt_curve_from_points(const double *codes, const double *light, int count, clt_curve *curve,
                                 clt_error *error) {
  bool ends = count >= 2 && codes[0] == 0 && codes[count - 1] == 1 && light[0] == 0 && light[count - 1] == 1;
  for (int i = 1; i < count && ends; i++) {
    if (!(codes[i] > codes[i - 1]) || !(light[i] >= light[i - 1])) {
      return clt_fail(error, CLT_BAD_INPUT,
                      "a response curve from (%g, %g) to (%g, %g); codes must ascend, and light "
                      "must not fall",
                      codes[i - 1], light[i - 1], codes[i], light[i]);
    }
  }
  if (!ends) {
    return clt_fail(error, CLT_BAD_INPUT, "a response curve of %d points; it needs at least two, from (0, 0) to (1, 1)",
                    count);
  }
  *curve = (clt_curve){.kind = CLT_CURVE_TABLE};
  for (int i = 0; i < CLT_CURVE_SAMPLES; i++) {
    curve->table[i] = clt_pchip_at(codes, light, count, (double)i / (CLT_CURVE_SAMPLES - 1));
  }
  return CLT_OK;
}

/* NaN becomes 0. */
static double clip(double value) {
  return value > 0 ? (value < 1 ? value : 1) : 0;
}

double clt_curve_decode(const clt_curve *curve, double code) {
  double v = clip(code);
  switch (curve->kind) {
  case CLT_CURVE_LINEAR:
    break;
  case CLT_CURVE_SRGB:
    return v <= srgb_joint_code ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
  case CLT_CURVE_GAMMA:
    return pow(v, curve->gamma);
  case CLT_CURVE_TABLE:
    return clt_pchip_at(NULL, curve->table, CLT_CURVE_SAMPLES, v);
  }
  return v;
}

double clt_curve_encode(const clt_curve *curve, double light) {
  double l = clip(light);
  switch (curve->kind) {
  case CLT_CURVE_LINEAR:
    break;
  case CLT_CURVE_SRGB:
    return l <= srgb_joint_light ? 12.92 * l : 1 + 1.055 * (pow(l, 1 / 2.4) - 1);
  case CLT_CURVE_GAMMA:
    return pow(l, 1 / curve->gamma);
  case CLT_CURVE_TABLE:
    return clt_pchip_inverse(NULL, curve->table, CLT_CURVE_SAMPLES, l);
  }
  return l;
}
