/* Pictures by their file's ending. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "image/format.h"

static const clt_image_format *const formats[] = {&clt_format_png, &clt_format_jpeg, &clt_format_exr, &clt_format_npy};
static const clt_curve srgb = {.kind = CLT_CURVE_SRGB};

/* The format of the path's ending, or NULL. */
static const clt_image_format *format_of(const char *path) {
  const char *slash = strrchr(path, '/');
  const char *ending = strrchr(slash == NULL ? path : slash, '.');
  if (ending == NULL) {
    return NULL;
  }
  for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++) {
    for (int k = 0; k < 2 && formats[i]->endings[k] != NULL; k++) {
      if (strcasecmp(ending, formats[i]->endings[k]) == 0) {
        return formats[i];
      }
    }
  }
  return NULL;
}

static clt_status fail_ending(const char *path, clt_error *error) {
  return clt_fail(error, CLT_BAD_INPUT, "%s: a picture's file ends in .png, .jpg, .jpeg, .exr or .npy", path);
}

bool clt_image_path_is_linear(const char *path) {
  const clt_image_format *format = format_of(path);
  return format != NULL && format->linear;
}

static clt_status check_finite(const char *path, const clt_image *image, clt_error *error) {
  size_t size = clt_image_size(image), plane = (size_t)image->height * (size_t)image->width;
  for (size_t i = 0; i < size; i++) {
    if (!isfinite(image->data[i])) {
      size_t pixel = i % plane, width = (size_t)image->width;
      return clt_fail(error, CLT_BAD_INPUT,
                      "%s: the sample in channel %zu, row %zu, column %zu is not finite; replace NaN and infinity",
                      path, i / plane, pixel / width, pixel % width);
    }
  }
  return CLT_OK;
}

clt_status clt_image_read(const char *path, const clt_curve *curve, clt_image *image, clt_error *error) {
  *image = (clt_image){0};
  const clt_image_format *format = format_of(path);
  if (format == NULL) {
    return fail_ending(path, error);
  }
  clt_status status = format->read(path, curve == NULL ? &srgb : curve, image, error);
  if (status == CLT_OK) {
    status = check_finite(path, image, error);
  }
  if (status != CLT_OK) {
    clt_image_finish(image);
  }
  return status;
}

clt_status clt_image_write(const char *path, const clt_curve *curve, const clt_image *image, clt_error *error) {
  const clt_image_format *format = format_of(path);
  if (format == NULL) {
    return fail_ending(path, error);
  }
  if (image->data == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: there is no picture to write", path);
  }
  return format->write(path, curve == NULL ? &srgb : curve, image, error);
}

/* Opens without waiting, lest a named pipe stops the caller, and refuses all but regular files. */
static clt_status open_regular(const char *path, int *descriptor, size_t *size, clt_error *error) {
  *descriptor = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat about;
  if (*descriptor < 0 || fstat(*descriptor, &about) != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be opened: %s; check the name", path, strerror(errno));
  }
  if (!S_ISREG(about.st_mode)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is no file; give a picture's name", path);
  }
  *size = (size_t)about.st_size;
  return CLT_OK;
}

static clt_status read_all(const char *path, int descriptor, clt_bytes *file, clt_error *error) {
  for (size_t done = 0; done < file->size;) {
    ssize_t more = read(descriptor, file->bytes + done, file->size - done);
    if (more < 0 && errno == EINTR) {
      continue;
    }
    if (more <= 0) {
      return clt_fail(error, CLT_FAILED, "%s: cannot be read: %s", path,
                      more < 0 ? strerror(errno) : "it was cut off while it was read");
    }
    done += (size_t)more;
  }
  return CLT_OK;
}

clt_status clt_bytes_load(const char *path, clt_bytes *file, clt_error *error) {
  *file = (clt_bytes){0};
  int descriptor = -1;
  clt_status status = open_regular(path, &descriptor, &file->size, error);
  if (status != CLT_OK) {
    goto finish;
  }
  file->bytes = malloc(file->size + 1);
  if (file->bytes == NULL) {
    status = clt_fail(error, CLT_FAILED, "%s: memory is short for its %zu bytes", path, file->size);
    goto finish;
  }
  status = read_all(path, descriptor, file, error);
finish:
  if (status != CLT_OK) {
    free(file->bytes);
    *file = (clt_bytes){0};
  }
  if (descriptor >= 0) {
    close(descriptor);
  }
  return status;
}
