#include "base/file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

void clt_file_stamp(const char *path, char *stamp) {
  struct stat file;
  stamp[0] = '\0';
  if (stat(path, &file) == 0 && S_ISREG(file.st_mode)) {
    snprintf(stamp, CLT_STAMP_MAX, "%" PRIdMAX ".%09ld, %" PRIdMAX, (intmax_t)file.st_mtim.tv_sec, file.st_mtim.tv_nsec,
             (intmax_t)file.st_size);
  }
}

void clt_file_folder(const char *path, char *out) {
  const char *slash = strrchr(path, '/');
  if (slash == NULL) {
    memcpy(out, ".", 2);
    return;
  }
  int length = slash == path ? 1 : (int)(slash - path);
  snprintf(out, CLT_PATH_MAX, "%.*s", length, path);
}

clt_status clt_file_join(const char *folder, const char *name, char *out, clt_error *error) {
  int used =
      name[0] == '/' ? snprintf(out, CLT_PATH_MAX, "%s", name) : snprintf(out, CLT_PATH_MAX, "%s/%s", folder, name);
  if (used < 0 || used >= CLT_PATH_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%.80s...: the path is longer than %d characters", name, CLT_PATH_MAX - 1);
  }
  return CLT_OK;
}

clt_status clt_file_begin(const char *path, char *temporary, clt_error *error) {
  char folder[CLT_PATH_MAX];
  clt_file_folder(path, folder);
  const char *slash = strrchr(path, '/');
  const char *name = path + (slash == NULL ? 0 : slash - path + 1);
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  int used = snprintf(temporary, CLT_PATH_MAX, "%s/.new-%ld-%lx-%s", folder, (long)getpid(),
                      (unsigned long)now.tv_nsec ^ (unsigned long)now.tv_sec, name);
  if (strlen(path) >= CLT_PATH_MAX || used < 0 || used >= CLT_PATH_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "%.80s...: the path is longer than %d characters", path, CLT_PATH_MAX - 48);
  }
  if (name[0] == '\0') {
    return clt_fail(error, CLT_BAD_INPUT, "%s: names a folder; give a file's name", path);
  }
  if (access(folder, W_OK | X_OK) != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the folder cannot be written to: %s; create it or choose another",
                    folder, strerror(errno));
  }
  return CLT_OK;
}

static clt_status sync_path(const char *path, int flags, clt_error *error) {
  int descriptor = open(path, flags | O_CLOEXEC);
  if (descriptor < 0 || (fsync(descriptor) != 0 && errno != EINVAL)) {
    int cause = errno;
    if (descriptor >= 0) {
      close(descriptor);
    }
    return clt_fail(error, CLT_FAILED, "%s: cannot be brought to the disk: %s", path, strerror(cause));
  }
  close(descriptor);
  return CLT_OK;
}

clt_status clt_file_commit(const char *temporary, const char *path, clt_error *error) {
  clt_status status = sync_path(temporary, O_RDONLY, error);
  if (status == CLT_OK && rename(temporary, path) != 0) {
    status = clt_fail(error, CLT_FAILED, "%s: cannot be replaced: %s", path, strerror(errno));
  }
  if (status != CLT_OK) {
    clt_file_abandon(temporary);
    return status;
  }
  char folder[CLT_PATH_MAX];
  clt_file_folder(path, folder);
  return sync_path(folder, O_RDONLY | O_DIRECTORY, error);
}

void clt_file_abandon(const char *temporary) {
  unlink(temporary);
}

static clt_status write_all(const char *path, const char *bytes, size_t size, clt_error *error) {
  int descriptor = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor < 0) {
    return clt_fail(error, CLT_FAILED, "%s: cannot be created: %s", path, strerror(errno));
  }
  for (size_t done = 0; done < size;) {
    ssize_t more = write(descriptor, bytes + done, size - done);
    if (more < 0 && errno == EINTR) {
      continue;
    }
    if (more < 0) {
      int cause = errno;
      close(descriptor);
      return clt_fail(error, CLT_FAILED, "%s: cannot be written: %s", path, strerror(cause));
    }
    done += (size_t)more;
  }
  close(descriptor);
  return CLT_OK;
}

clt_status clt_file_write(const char *path, const void *bytes, size_t size, clt_error *error) {
  char temporary[CLT_PATH_MAX];
  clt_status status = clt_file_begin(path, temporary, error);
  if (status != CLT_OK) {
    return status;
  }
  status = write_all(temporary, bytes, size, error);
  if (status != CLT_OK) {
    clt_file_abandon(temporary);
    return status;
  }
  return clt_file_commit(temporary, path, error);
}

clt_status clt_text_open(clt_text *text, const char *path, clt_error *error) {
  *text = (clt_text){0};
  if (snprintf(text->path, sizeof text->path, "%s", path) >= (int)sizeof text->path) {
    return clt_fail(error, CLT_BAD_INPUT, "%.60s...: the path is too long", path);
  }
  text->to = open_memstream(&text->bytes, &text->size);
  return text->to != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "%s: not enough memory to write it", path);
}

clt_status clt_text_close(clt_text *text, clt_status status, clt_error *error) {
  if (text->to != NULL && fclose(text->to) != 0 && status == CLT_OK) {
    status = clt_fail(error, CLT_FAILED, "%s: not enough memory to write it", text->path);
  }
  if (status == CLT_OK) {
    status = clt_file_write(text->path, text->bytes, text->size, error);
  }
  free(text->bytes);
  *text = (clt_text){0};
  return status;
}
