#include "image/codecs.h"

#include <dlfcn.h>
#include <stdlib.h>

/* Found by the run path of the program or library that this is part of. */
static const char module_name[] = "libcounterlight-codecs.so";

/* Debian's OpenCV has its EXR codec switched off until this variable is set. It is set while the program is loaded,
 * because later another thread may be reading the environment. */
__attribute__((constructor)) static void enable_exr(void) {
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
}

/* A table of the module, or NULL. What was loaded stays (RTLD_NODELETE): from the second time on this is a look-up. */
static const void *find(const char *table, clt_error *error) {
  void *module = dlopen(module_name, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  const void *found = module != NULL ? dlsym(module, table) : NULL;
  if (found == NULL) {
    clt_fail(error, CLT_FAILED, "pictures and films cannot be read or written: %s; install counterlight whole",
             dlerror());
    return NULL;
  }
  dlclose(module);
  return found;
}

static const clt_picture_codecs *pictures(clt_error *error) {
  return find("clt_module_pictures", error);
}

static const clt_video_codecs *videos(clt_error *error) {
  return find("clt_module_videos", error);
}

clt_status clt_opencv_decode(const char *path, const unsigned char *bytes, size_t size, bool grey, clt_raster *raster,
                             clt_error *error) {
  *raster = (clt_raster){0};
  const clt_picture_codecs *codecs = pictures(error);
  return codecs != NULL ? codecs->decode(path, bytes, size, grey, raster, error) : CLT_FAILED;
}

clt_status clt_opencv_encode(const char *path, const char *ending, const clt_raster *raster, unsigned char **bytes,
                             size_t *size, clt_error *error) {
  *bytes = NULL;
  const clt_picture_codecs *codecs = pictures(error);
  return codecs != NULL ? codecs->encode(path, ending, raster, bytes, size, error) : CLT_FAILED;
}

clt_status clt_opencv_read_exr(const char *path, clt_raster *raster, clt_error *error) {
  *raster = (clt_raster){0};
  const clt_picture_codecs *codecs = pictures(error);
  return codecs != NULL ? codecs->read_exr(path, raster, error) : CLT_FAILED;
}

clt_status clt_opencv_write_exr(const char *path, const clt_raster *raster, clt_error *error) {
  const clt_picture_codecs *codecs = pictures(error);
  return codecs != NULL ? codecs->write_exr(path, raster, error) : CLT_FAILED;
}

clt_status clt_video_open(const char *path, clt_video **out, clt_video_info *info, clt_error *error) {
  *out = NULL;
  const clt_video_codecs *codecs = videos(error);
  return codecs != NULL ? codecs->open(path, out, info, error) : CLT_FAILED;
}

void clt_video_close(clt_video *video) {
  const clt_video_codecs *codecs = video != NULL ? videos(NULL) : NULL;
  if (codecs != NULL) {
    codecs->close(video);
  }
}

clt_status clt_video_read(clt_video *video, const int rectangle[4], uint8_t *codes, bool *end, clt_error *error) {
  const clt_video_codecs *codecs = videos(error);
  return codecs != NULL ? codecs->read(video, rectangle, codes, end, error) : CLT_FAILED;
}

clt_status clt_video_rewind(clt_video *video, clt_error *error) {
  const clt_video_codecs *codecs = videos(error);
  return codecs != NULL ? codecs->rewind(video, error) : CLT_FAILED;
}
