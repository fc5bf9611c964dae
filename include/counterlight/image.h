/* Pictures: planar float images in linear light, tone curves, and the files that hold them. */
#ifndef COUNTERLIGHT_IMAGE_H
#define COUNTERLIGHT_IMAGE_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A planar picture: data[(c * height + y) * width + x], linear light, row 0 at the top, channels in the order R, G, B
 * (or one channel). Values are radiances or drives; nothing clips them. The image owns data. A zeroed clt_image is a
 * valid empty image. */
typedef struct clt_image {
  int channels, height, width;
  float *data;
} clt_image;

/* Allocates a black image of channels x height x width (each >= 1, at most 32768 a side, 1..4 channels). */
CLT_PUBLIC clt_status clt_image_init(clt_image *image, int channels, int height, int width, clt_error *error);
/* Frees the samples and empties the image; accepts an empty image and NULL. */
CLT_PUBLIC void clt_image_finish(clt_image *image);
/* Samples in the image: channels * height * width. */
CLT_PUBLIC size_t clt_image_size(const clt_image *image);

/* How a code value v in 0..1 (a panel value, a camera sample over full scale, a PNG sample) stands for linear light
 * in 0..1. A response curve of a projector or camera is one of these. */
typedef enum clt_curve_kind { CLT_CURVE_LINEAR, CLT_CURVE_SRGB, CLT_CURVE_GAMMA, CLT_CURVE_TABLE } clt_curve_kind;
enum { CLT_CURVE_SAMPLES = 65 };
typedef struct clt_curve {
  clt_curve_kind kind;
  double gamma; /* CLT_CURVE_GAMMA: light = v^gamma, 0.2..5 */
  /* CLT_CURVE_TABLE: light at the codes i / 64, from 0 to 1 and never falling; monotone cubics between (Fritsch &
   * Butland 1984). A curve that was measured. */
  double table[CLT_CURVE_SAMPLES];
} clt_curve;

/* Reads "linear", "srgb" or "gamma 2.2" (also "gamma:2.2"). */
CLT_PUBLIC clt_status clt_curve_parse(const char *text, clt_curve *curve, clt_error *error);
/* Writes the same text back, or "table", which names a measured curve without saying it; size >= 24 holds every text.
 */
CLT_PUBLIC void clt_curve_format(const clt_curve *curve, char *text, size_t size);
/* The table through count points (codes[i], light[i]) that begin at (0, 0) and end at (1, 1): codes ascend, light does
 * not fall (CLT_BAD_INPUT otherwise). */
CLT_PUBLIC clt_status clt_curve_from_points(const double *codes, const double *light, int count, clt_curve *curve,
                                            clt_error *error);
/* Code value to linear light, and back. Both are monotone, map 0 to 0 and 1 to 1, and clip their argument to 0..1. */
CLT_PUBLIC double clt_curve_decode(const clt_curve *curve, double code);
CLT_PUBLIC double clt_curve_encode(const clt_curve *curve, double light);

/* True where the file's ending says that it holds linear floats (.npy, .exr) rather than encoded samples. */
CLT_PUBLIC bool clt_image_path_is_linear(const char *path);

/* Reads a picture by its ending: .png .jpg .jpeg (8 or 16 bit, decoded by curve, NULL meaning sRGB; grey stays one
 * channel, alpha is dropped), .exr and .npy (float32 or float64, [channels, height, width] or [height, width], linear,
 * no decoding). Non-finite samples are refused. CLT_BAD_INPUT where the file is missing, is no picture, or is of a
 * wrong kind; the message names the file. On failure image is empty. */
CLT_PUBLIC clt_status clt_image_read(const char *path, const clt_curve *curve, clt_image *image, clt_error *error);

/* Writes a picture by its ending: .png (8 bit) and .jpg clip to 0..1 and encode by curve (NULL: sRGB); .exr and .npy
 * keep linear float32. The file is written under a temporary name in the same folder, synced and renamed. */
CLT_PUBLIC clt_status clt_image_write(const char *path, const clt_curve *curve, const clt_image *image,
                                      clt_error *error);

/* Resamples by exact area averages in linear light (magnification: bilinear) to height x width. `out` is initialised
 * here. The whole picture is kept: where the aspect ratios differ, the centre of `in` is cropped to fit. */
CLT_PUBLIC clt_status clt_image_resize(const clt_image *in, int height, int width, clt_image *out, clt_error *error);

/* Gives out `channels` channels: one channel is repeated, three are averaged by luminance (Rec. 709) into one. */
CLT_PUBLIC clt_status clt_image_convert(const clt_image *in, int channels, clt_image *out, clt_error *error);

/* Paints one channel of values over 0..top (clipped) with a perceptually ordered colour map (dark = 0) into an
 * sRGB-ready three-channel linear image, for error maps. */
CLT_PUBLIC clt_status clt_image_heatmap(const clt_image *values, double top, clt_image *out, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
