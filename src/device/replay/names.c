#include "device/replay/names.h"

#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"

enum { PICTURES_MAX = 100000 };

clt_status clt_names_add(clt_names *names, const char *folder, const char *name, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = clt_file_join(folder, name, path, error);
  if (status != CLT_OK) {
    return status;
  }
  char **more = names->count < PICTURES_MAX ? realloc(names->path, ((size_t)names->count + 1) * sizeof *more) : NULL;
  if (more != NULL) {
    names->path = more;
    more[names->count] = strdup(path);
  }
  if (more == NULL || more[names->count] == NULL) {
    return clt_fail(error, CLT_FAILED, "%s: memory is short for more than %d names", folder, names->count);
  }
  names->count++;
  return CLT_OK;
}

void clt_names_finish(clt_names *names) {
  for (int k = 0; k < names->count; k++) {
    free(names->path[k]);
  }
  free(names->path);
  *names = (clt_names){0};
}

static bool is_picture(const char *name) {
  const char *ending = strrchr(name, '.');
  return name[0] != '.' && ending != NULL &&
         (strcasecmp(ending, ".png") == 0 || strcasecmp(ending, ".jpg") == 0 || strcasecmp(ending, ".jpeg") == 0);
}

static int compare_names(const void *left, const void *right) {
  return strcmp(*(char *const *)left, *(char *const *)right);
}

static clt_status list_folder(const char *folder, clt_names *names, clt_error *error) {
  DIR *directory = opendir(folder);
  clt_status status = CLT_OK;
  if (directory == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the folder cannot be read: %s", folder, strerror(errno));
  }
  for (struct dirent *entry; status == CLT_OK && (entry = readdir(directory)) != NULL;) {
    if (is_picture(entry->d_name)) {
      status = clt_names_add(names, folder, entry->d_name, error);
    }
  }
  closedir(directory);
  if (names->count > 0) {
    qsort(names->path, (size_t)names->count, sizeof *names->path, compare_names);
  }
  return status;
}

static clt_status read_list(const char *path, clt_names *names, clt_error *error) {
  char folder[CLT_PATH_MAX];
  clt_file_folder(path, folder);
  return clt_opencv_read_names(path, folder, names, error);
}

clt_status clt_names_find(const char *path, clt_names *names, clt_error *error) {
  char list[CLT_PATH_MAX];
  struct stat about;
  *names = (clt_names){0};
  if (stat(path, &about) != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be opened: %s; check the name", path, strerror(errno));
  }
  clt_status status = clt_file_join(path, "list.yaml", list, error);
  if (status == CLT_OK) {
    status = !S_ISDIR(about.st_mode)   ? read_list(path, names, error)
             : access(list, F_OK) == 0 ? read_list(list, names, error)
                                       : list_folder(path, names, error);
  }
  if (status == CLT_OK && names->count == 0) {
    status = clt_fail(error, CLT_BAD_INPUT, "%s: there are no pictures (.png, .jpg, .jpeg) and no list.yaml", path);
  }
  if (status != CLT_OK) {
    clt_names_finish(names);
  }
  return status;
}
