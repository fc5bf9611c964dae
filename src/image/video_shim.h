/* OpenCV's video decoders for C. */
#ifndef CLT_IMAGE_VIDEO_SHIM_H
#define CLT_IMAGE_VIDEO_SHIM_H

#include <stdbool.h>
#include <stdint.h>

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct clt_video clt_video;

typedef struct clt_video_info {
  int width, height;
  double rate_hz; /* frames a second; 25 where the file does not say */
} clt_video_info;

/* CLT_BAD_INPUT where the file is no video that can be decoded. One call at a time for each video. */
clt_status clt_video_open(const char *path, clt_video **out, clt_video_info *info, clt_error *error);
void clt_video_close(clt_video *video); /* accepts NULL */
/* The next frame's columns left <= x < left + width and rows likewise, as codes[(y * width + x) * 3 + c], R, G, B.
 * *end: there is no further frame, and codes stays as it is. */
clt_status clt_video_read(clt_video *video, const int rectangle[4], uint8_t *codes, bool *end, clt_error *error);
/* Back to the first frame. */
clt_status clt_video_rewind(clt_video *video, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
