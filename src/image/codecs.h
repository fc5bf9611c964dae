/* The module of OpenCV's codecs. They bring some two hundred shared libraries along (GDAL, FFmpeg, GStreamer), which
 * take longer to load than all the rest of a program; so they lie in a shared module, which is loaded when the first
 * picture or film is read or written. codecs.c loads it; opencv_shim.cpp and video_shim.cpp are what it holds. */
#ifndef CLT_IMAGE_CODECS_H
#define CLT_IMAGE_CODECS_H

#include "image/opencv_shim.h"
#include "image/video_shim.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As the functions clt_opencv_... of opencv_shim.h and clt_video_... of video_shim.h. */
typedef struct clt_picture_codecs {
  clt_status (*decode)(const char *path, const unsigned char *bytes, size_t size, bool grey, clt_raster *raster,
                       clt_error *error);
  clt_status (*encode)(const char *path, const char *ending, const clt_raster *raster, unsigned char **bytes,
                       size_t *size, clt_error *error);
  clt_status (*read_exr)(const char *path, clt_raster *raster, clt_error *error);
  clt_status (*write_exr)(const char *path, const clt_raster *raster, clt_error *error);
} clt_picture_codecs;

typedef struct clt_video_codecs {
  clt_status (*open)(const char *path, clt_video **out, clt_video_info *info, clt_error *error);
  void (*close)(clt_video *video);
  clt_status (*read)(clt_video *video, const int rectangle[4], uint8_t *codes, bool *end, clt_error *error);
  clt_status (*rewind)(clt_video *video, clt_error *error);
} clt_video_codecs;

/* What the module exports. */
CLT_PUBLIC extern const clt_picture_codecs clt_module_pictures;
CLT_PUBLIC extern const clt_video_codecs clt_module_videos;

#ifdef __cplusplus
}
#endif
#endif
