#include "cli/folder.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "cli/picture.h"

clt_status cli_folder_choose(const char *given, const char *fallback, char *out, clt_error *error) {
  const char *name = given != NULL ? given : fallback;
  size_t length = strlen(name);
  while (length > 1 && name[length - 1] == '/') {
    length--;
  }
  if (length == 0 || length >= CLT_PATH_MAX) {
    return clt_fail(error, CLT_BAD_INPUT, "--output: the name of the folder is %s", length ? "too long" : "empty");
  }
  memcpy(out, name, length);
  out[length] = '\0';
  char probe[CLT_PATH_MAX];
  struct stat there;
  if (stat(out, &there)) {
    return cli_output_check(out, error);
  }
  if (!S_ISDIR(there.st_mode)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is there and is no folder; name another with --output", out);
  }
  clt_status status = clt_file_join(out, "result", probe, error);
  return status ? status : cli_output_check(probe, error);
}

clt_status cli_folder_make(const char *folder, clt_error *error) {
  return mkdir(folder, 0777) && errno != EEXIST
             ? clt_fail(error, CLT_FAILED, "%s: the folder cannot be made: %s", folder, strerror(errno))
             : CLT_OK;
}

clt_status cli_scenes_folder(const char **out, clt_error *error) {
  static const char *const places[] = {CLT_SOURCE_SCENES, CLT_INSTALLED_SCENES};
  for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
    if (access(places[i], R_OK) == 0) {
      *out = places[i];
      return CLT_OK;
    }
  }
  return clt_fail(error, CLT_FAILED, "%s: the scenes that come with counterlight are not there; install them",
                  places[1]);
}
