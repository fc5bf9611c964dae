#include "daemon/store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/places.h"
#include "daemon/probe.h"

static const char transport_name[] = "transport.h5", drive_name[] = "drive.npy", record_name[] = "state.json",
                  journal_name[] = "acquisition.journal";

clt_status store_path(const store *state, const char *name, char *out, clt_error *error) {
  return clt_file_join(state->folder, name, out, error);
}

/* Temporary files (base/file.h) of a daemon that was killed. */
static void sweep(const store *state) {
  DIR *folder = opendir(state->folder);
  for (struct dirent *entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
    if (strncmp(entry->d_name, ".new-", 5) == 0) {
      unlinkat(dirfd(folder), entry->d_name, 0);
    }
  }
  if (folder != NULL) {
    closedir(folder);
  }
}

/* The problem: why there is no lock, which is no failure. */
static clt_status take_lock(store *out, clt_error *problem, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = store_path(out, ".lock", path, error);
  if (status != CLT_OK) {
    return status;
  }
  out->lock = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0640);
  if (out->lock < 0) {
    clt_fail(problem, CLT_FAILED, "%s: %s", path, strerror(errno));
  }
  if (out->lock >= 0 && flock(out->lock, LOCK_EX | LOCK_NB) != 0) {
    store_close(out);
    return clt_fail(error, CLT_FAILED,
                    "%s: another counterlightd uses this state directory; stop it first, or give this one another "
                    "--state and --socket",
                    path);
  }
  out->writable = out->lock >= 0;
  return CLT_OK;
}

clt_status store_open(const char *folder, store *out, clt_error *error) {
  *out = (store){.lock = -1};
  snprintf(out->folder, sizeof out->folder, "%s", folder);
  clt_error problem = {0};
  clt_status status = CLT_OK;
  if (clt_place_make_folder(folder, 0750, &problem) == CLT_OK) {
    status = take_lock(out, &problem, error);
  }
  if (status == CLT_OK && !out->writable) {
    clt_log(CLT_LOG_WARNING, "%s: the state directory cannot be written to: nothing will survive a restart%s%s", folder,
            problem.message[0] != '\0' ? ": " : "", problem.message);
  } else if (status == CLT_OK) {
    sweep(out);
  }
  return status;
}

void store_close(store *state) {
  if (state->lock >= 0) {
    close(state->lock);
  }
  state->lock = -1;
}

static void take_text(const json_t *document, const char *key, char *out, size_t size) {
  const char *text = json_string_value(json_object_get(document, key));
  snprintf(out, size, "%s", text != NULL ? text : "");
}

void store_read_record(const store *state, store_record *record) {
  *record = (store_record){0};
  char path[CLT_PATH_MAX];
  json_t *document = store_path(state, record_name, path, NULL) == CLT_OK ? json_load_file(path, 0, NULL) : NULL;
  take_text(document, "configured", record->configured, sizeof record->configured);
  take_text(document, "content", record->content, sizeof record->content);
  take_text(document, "name", record->name, sizeof record->name);
  take_text(document, "drive_from", record->drive_from.path, sizeof record->drive_from.path);
  take_text(document, "stamp", record->drive_from.stamp, sizeof record->drive_from.stamp);
  const char *identity = json_string_value(json_object_get(document, "drive_of"));
  record->drive_of = identity != NULL ? strtoull(identity, NULL, 16) : 0;
  if (strchr(record->content, '/') != NULL) {
    record->content[0] = '\0'; /* only ever a name in this folder */
  }
  json_decref(document);
}

static clt_status not_writable(const store *state, const char *what, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s is not stored: the state directory %s cannot be written to", what,
                  state->folder);
}

clt_status store_write_record(const store *state, const store_record *record, clt_error *error) {
  char path[CLT_PATH_MAX], identity[24];
  clt_status status = state->writable ? store_path(state, record_name, path, error)
                                      : not_writable(state, "which picture is shown", error);
  if (status != CLT_OK) {
    return status;
  }
  snprintf(identity, sizeof identity, "%016" PRIx64, record->drive_of);
  json_t *document = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s}", "configured", record->configured, "content",
                               record->content, "name", record->name, "drive_of", identity, "drive_from",
                               record->drive_from.path, "stamp", record->drive_from.stamp);
  char *text = document != NULL ? json_dumps(document, JSON_INDENT(2)) : NULL;
  status = text != NULL ? clt_file_write(path, text, strlen(text), error)
                        : clt_fail(error, CLT_FAILED, "%s: a path in it is no UTF-8", path);
  free(text);
  json_decref(document);
  return status;
}

static void set_aside(const char *path, const char *suffix) {
  char aside[CLT_PATH_MAX + 32];
  snprintf(aside, sizeof aside, "%s.%s", path, suffix);
  if (rename(path, aside) == 0) {
    clt_log(CLT_LOG_NOTICE, "kept it as %s", aside);
  } else {
    clt_log(CLT_LOG_WARNING, "%s cannot be moved aside: %s", path, strerror(errno));
  }
}

bool store_is_foreign(const clt_transport *transport, int width, int height, int channels, const char *source,
                      char *why, size_t size) {
  clt_transport_info info = clt_transport_describe(transport);
  const char *origin = clt_transport_origin(transport)->source;
  bool other = width > 0 && (info.width != width || info.height != height || info.channels != channels);
  if (other || info.rows != info.cols) {
    snprintf(why, size, "its grid is %d x %d x %d, the rig's is %d x %d x %d", info.width, info.height, info.channels,
             width, height, channels);
    return true;
  }
  if (origin[0] != '\0' && source[0] != '\0' && strcmp(origin, source) != 0) {
    snprintf(why, size, "it was measured on \"%s\", the rig is \"%s\"", origin, source);
    return true;
  }
  return false;
}

clt_transport *store_load_transport(const store *state, int width, int height, int channels, const char *source) {
  char path[CLT_PATH_MAX], why[CLT_MESSAGE_MAX], suffix[32];
  clt_error error = {0};
  clt_transport *transport = NULL;
  if (store_path(state, transport_name, path, &error) != CLT_OK || access(path, F_OK) != 0) {
    return NULL;
  }
  if (!probe_transport(path)) {
    clt_fail(&error, CLT_BAD_INPUT, "%s: is damaged, reading it breaks down", path);
  } else {
    clt_transport_load(path, &transport, &error);
  }
  if (error.status != CLT_OK) {
    clt_log(CLT_LOG_ERROR, "the stored transport cannot be used: %s", error.message);
    snprintf(suffix, sizeof suffix, "bad-%lld", (long long)time(NULL));
    set_aside(path, suffix);
    return NULL;
  }
  if (store_is_foreign(transport, width, height, channels, source, why, sizeof why)) {
    clt_log(CLT_LOG_WARNING, "the stored transport %s is of another rig and not used: %s", path, why);
    clt_transport_destroy(transport);
    set_aside(path, "old");
    return NULL;
  }
  return transport;
}

clt_status store_save_transport(const store *state, const clt_transport *transport, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status =
      state->writable ? store_path(state, transport_name, path, error) : not_writable(state, "the transport", error);
  return status == CLT_OK ? clt_transport_save(transport, path, error) : status;
}

void store_journal_path(const char *folder, char path[CLT_PATH_MAX]) {
  if (clt_file_join(folder, journal_name, path, NULL) != CLT_OK) {
    path[0] = '\0';
  }
}

clt_status store_save_drive(const store *state, const clt_image *drive, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status =
      state->writable ? store_path(state, drive_name, path, error) : not_writable(state, "the drive", error);
  return status == CLT_OK ? clt_image_write(path, NULL, drive, error) : status;
}

bool store_load_drive(const store *state, clt_image *drive) {
  char path[CLT_PATH_MAX];
  return store_path(state, drive_name, path, NULL) == CLT_OK && access(path, R_OK) == 0 &&
         clt_image_read(path, NULL, drive, NULL) == CLT_OK;
}
