#include "daemon/content.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "daemon/input.h"

static const off_t file_most = (off_t)256 * 1024 * 1024;

/* FNV-1a, 64 bit. */
static uint64_t identify(const clt_image *picture) {
  const unsigned char *bytes = (const unsigned char *)picture->data;
  uint64_t hash = 0xcbf29ce484222325u;
  for (size_t i = 0; i < clt_image_size(picture) * sizeof *picture->data; i++) {
    hash = (hash ^ bytes[i]) * 0x100000001b3u;
  }
  return hash != 0 ? hash : 1;
}

/* The ending that goes with a file's first bytes, or NULL. */
static const char *ending_of(int descriptor) {
  static const struct {
    const char *bytes, *ending;
    size_t length;
  } kinds[] = {{"\x89PNG\r\n\x1a\n", "png", 8},
               {"\xff\xd8\xff", "jpg", 3},
               {"\x76\x2f\x31\x01", "exr", 4},
               {"\x93NUMPY", "npy", 6}};
  char first[8] = {0};
  ssize_t count = pread(descriptor, first, sizeof first, 0);
  for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
    if (count >= (ssize_t)kinds[i].length && memcmp(first, kinds[i].bytes, kinds[i].length) == 0) {
      return kinds[i].ending;
    }
  }
  return NULL;
}

static clt_status check_file(int descriptor, const char *name, const char **ending, clt_error *error) {
  struct stat found;
  if (fstat(descriptor, &found) != 0 || !S_ISREG(found.st_mode)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is no regular file", name);
  }
  if (found.st_size > file_most) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is larger than %ld MiB", name, (long)(file_most >> 20));
  }
  *ending = ending_of(descriptor);
  return *ending != NULL ? CLT_OK
                         : clt_fail(error, CLT_BAD_INPUT, "%s: is no picture: PNG, JPEG, EXR or npy are taken", name);
}

static clt_status copy_file(int from, const char *path, clt_error *error) {
  int to = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0640);
  char *block = malloc(1 << 20);
  off_t at = 0;
  ssize_t count = to >= 0 && block != NULL ? 1 : -1;
  while (count > 0 && at <= file_most) {
    count = pread(from, block, 1 << 20, at);
    at += count > 0 ? count : 0;
    count = count > 0 && write(to, block, (size_t)count) != count ? -1 : count;
  }
  int cause = errno;
  free(block);
  if (to >= 0) {
    close(to);
  }
  return count == 0 ? CLT_OK : clt_fail(error, CLT_FAILED, "%s: cannot be copied there: %s", path, strerror(cause));
}

static store_source look_at(const char *path) {
  store_source from;
  snprintf(from.path, sizeof from.path, "%s", path);
  clt_file_stamp(path, from.stamp);
  return from;
}

static bool is_same(const store_source *a, const store_source *b) {
  return strcmp(a->stamp, b->stamp) == 0 && strcmp(a->path, b->path) == 0;
}

static void adopt(content *shown, clt_image *picture, const store_source *from) {
  clt_image_finish(&shown->picture);
  shown->picture = *picture;
  shown->identity = identify(picture);
  shown->from = *from;
}

static void name_it(content *shown, const char *name) {
  snprintf(shown->name, sizeof shown->name, "%s", name);
}

static void keep_record(const store *state, content *shown) {
  clt_error error = {0};
  if (store_write_record(state, &shown->record, &error) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "%s", error.message);
  }
}

/* Notes that the copied file is the content from now on, and removes the copy that it replaces. */
static void keep_copy(const store *state, const char *copy, const char *ending, const char *configured,
                      content *shown) {
  char path[CLT_PATH_MAX], older[CLT_PATH_MAX], file[64];
  clt_error error = {0};
  snprintf(file, sizeof file, "content.%s", ending);
  if (store_path(state, file, path, &error) != CLT_OK || clt_file_commit(copy, path, &error) != CLT_OK) {
    clt_log(CLT_LOG_WARNING, "the picture will not survive a restart: %s", error.message);
    return;
  }
  shown->from = look_at(path);
  bool replaces = shown->record.content[0] != '\0' && strcmp(shown->record.content, file) != 0;
  bool stale = replaces && store_path(state, shown->record.content, older, NULL) == CLT_OK;
  snprintf(shown->record.content, sizeof shown->record.content, "%s", file);
  snprintf(shown->record.name, sizeof shown->record.name, "%s", shown->name);
  snprintf(shown->record.configured, sizeof shown->record.configured, "%s", configured);
  keep_record(state, shown);
  if (stale) {
    unlink(older);
  }
}

/* Where the copy is made: beside its place, or in /tmp while the state directory cannot be written. */
static clt_status name_copy(const store *state, const char *ending, char *copy, clt_error *error) {
  char path[CLT_PATH_MAX], file[64];
  snprintf(file, sizeof file, "content.%s", ending);
  clt_status status = state->writable ? store_path(state, file, path, error) : clt_file_join("/tmp", file, path, error);
  return status == CLT_OK ? clt_file_begin(path, copy, error) : status;
}

clt_status content_take(const store *state, const char *configured, int descriptor, const char *name, content *shown,
                        clt_error *error) {
  char copy[CLT_PATH_MAX];
  const char *ending = NULL;
  clt_image picture = {0};
  clt_status status = check_file(descriptor, name, &ending, error);
  status = status == CLT_OK ? name_copy(state, ending, copy, error) : status;
  if (status != CLT_OK) {
    return status;
  }
  status = copy_file(descriptor, copy, error);
  if (status == CLT_OK && clt_image_read(copy, NULL, &picture, error) != CLT_OK) {
    status = clt_fail(error, CLT_BAD_INPUT, "%s: is damaged or no picture that can be read", name);
  }
  if (status == CLT_OK) {
    adopt(shown, &picture, &(store_source){0});
    name_it(shown, name);
  }
  if (status == CLT_OK && state->writable) {
    keep_copy(state, copy, ending, configured, shown);
  }
  clt_file_abandon(copy);
  return status;
}

clt_status content_reset(const store *state, const char *configured, content *shown, clt_error *error) {
  clt_image picture = {0};
  const store_source from = look_at(configured);
  clt_status status = input_poster(configured, &picture, error);
  if (status != CLT_OK) {
    return status;
  }
  adopt(shown, &picture, &from);
  name_it(shown, configured);
  if (shown->record.content[0] != '\0') {
    shown->record = (store_record){.drive_of = shown->record.drive_of, .drive_from = shown->record.drive_from};
    keep_record(state, shown);
  }
  return CLT_OK;
}

clt_status content_open(const store *state, const char *configured, content *out, clt_error *error) {
  *out = (content){0};
  store_read_record(state, &out->record);
  char path[CLT_PATH_MAX];
  clt_image picture = {0};
  bool brought = out->record.content[0] != '\0' && strcmp(out->record.configured, configured) == 0 &&
                 store_path(state, out->record.content, path, NULL) == CLT_OK;
  const store_source from = look_at(brought ? path : configured);
  name_it(out, brought ? out->record.name : configured);
  if (from.stamp[0] != '\0' && is_same(&from, &out->record.drive_from) && out->record.drive_of != 0) {
    out->identity = out->record.drive_of;
    out->from = from;
    return CLT_OK;
  }
  if (!brought || clt_image_read(path, NULL, &picture, NULL) != CLT_OK) {
    return content_reset(state, configured, out, error);
  }
  adopt(out, &picture, &from);
  return CLT_OK;
}

clt_status content_decode(content *shown, clt_error *error) {
  if (shown->picture.data != NULL) {
    return CLT_OK;
  }
  clt_image picture = {0};
  const store_source from = look_at(shown->from.path);
  clt_status status = input_poster(from.path, &picture, error);
  if (status == CLT_OK) {
    adopt(shown, &picture, &from);
  }
  return status;
}

clt_status content_keep_drive(const store *state, content *shown, const clt_image *drive, clt_error *error) {
  clt_status status = store_save_drive(state, drive, error);
  if (status != CLT_OK ||
      (shown->record.drive_of == shown->identity && is_same(&shown->from, &shown->record.drive_from))) {
    return status;
  }
  shown->record.drive_of = shown->identity;
  shown->record.drive_from = shown->from;
  return store_write_record(state, &shown->record, error);
}

void content_finish(content *shown) {
  clt_image_finish(&shown->picture);
}
