#include "device/replay/index.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/memory.h"
#include "base/random.h"

#define TITLE "counterlight-recording 1"
enum { LINE_MAX_LENGTH = 512, SIDE_MAX = 32768, FRAMES_MAX = 1000000 };

clt_status clt_index_path(const char *folder, char *out, clt_error *error) {
  return clt_file_join(folder, "index.txt", out, error);
}

/* A line that ends in a newline, without it; false at the end of the file. */
typedef struct reader {
  FILE *from;
  char path[CLT_PATH_MAX], line[LINE_MAX_LENGTH];
  long number;
} reader;

static clt_status fail_line(const reader *r, const char *what, clt_error *error) {
  return clt_fail(error, CLT_BAD_INPUT, "%s:%ld: %s; the recording is damaged: record again, or take the line out",
                  r->path, r->number, what);
}

/* *there: whether a line came. */
static clt_status read_line(reader *r, bool *there, clt_error *error) {
  r->number++;
  *there = fgets(r->line, sizeof r->line, r->from) != NULL;
  if (!*there) {
    return ferror(r->from) ? clt_fail(error, CLT_FAILED, "%s: cannot be read: %s", r->path, strerror(errno)) : CLT_OK;
  }
  size_t length = strlen(r->line);
  if (length == 0 || r->line[length - 1] != '\n') {
    return fail_line(r, "the line is cut off or too long", error);
  }
  r->line[length - 1] = '\0';
  return CLT_OK;
}

static bool take_panel(const char *line, clt_projector_info *panel) {
  int end = 0;
  return sscanf(line, "panel %d %d %d %d %lf%n", &panel->width, &panel->height, &panel->channels, &panel->bits,
                &panel->refresh_s, &end) == 5 &&
         line[end] == '\0' && panel->width >= 1 && panel->width <= SIDE_MAX && panel->height >= 1 &&
         panel->height <= SIDE_MAX && (panel->channels == 1 || panel->channels == 3) && panel->bits >= 1 &&
         panel->bits <= 16 && panel->refresh_s > 0;
}

/* Recordings from before there was a step have none. */
static bool take_camera(const char *line, clt_camera_info *c) {
  int end = 0, own = 0, step = 0;
  int count = sscanf(line, "camera %d %d %d %d %lf %lf %lf %lf %lf %lf %lf %d%n", &c->width, &c->height, &c->channels,
                     &c->bits, &c->frame_s, &c->exposure_min_s, &c->exposure_max_s, &c->black_level, &c->responsivity,
                     &c->full_well, &c->read_noise, &own, &end);
  c->own_pixels = own == 1;
  c->step = 0;
  end += count == 12 && sscanf(line + end, " %lf%n", &c->step, &step) == 1 ? step : 0;
  return count == 12 && c->step >= 0 && (own == 0 || own == 1) && line[end] == '\0' && c->width >= 1 &&
         c->width <= SIDE_MAX && c->height >= 1 && c->height <= SIDE_MAX && (c->channels == 1 || c->channels == 3) &&
         c->bits >= 1 && c->bits <= 16 && c->frame_s > 0 && c->exposure_min_s > 0 &&
         c->exposure_max_s >= c->exposure_min_s && c->black_level >= 0 && c->black_level < (1 << c->bits) - 1 &&
         c->responsivity > 0 && c->full_well > 0 && c->read_noise >= 0;
}

static bool take_record(const char *line, clt_record *record) {
  int end = 0;
  return sscanf(line, "frame %" SCNu32 " %ld %" SCNx64 " %" SCNd64 " %" SCNd64 " %lf %31s%n", &record->sequence,
                &record->pattern, &record->hash, &record->shown_ns, &record->exposed_ns, &record->exposure_s,
                record->file, &end) == 7 &&
         line[end] == '\0' && record->pattern >= 0 && record->exposure_s > 0 && strchr(record->file, '/') == NULL &&
         record->file[0] != '.';
}

static clt_status read_head(reader *r, clt_index *index, clt_error *error) {
  bool there;
  clt_status status = read_line(r, &there, error);
  if (status == CLT_OK && (!there || strcmp(r->line, TITLE) != 0)) {
    status = fail_line(r, "this is not the line '" TITLE "'", error);
  }
  if (status == CLT_OK && (status = read_line(r, &there, error)) == CLT_OK) {
    status = there && take_panel(r->line, &index->panel) ? CLT_OK : fail_line(r, "no legal panel line", error);
  }
  if (status == CLT_OK && (status = read_line(r, &there, error)) == CLT_OK) {
    status = there && take_camera(r->line, &index->sensor) ? CLT_OK : fail_line(r, "no legal camera line", error);
  }
  return status;
}

/* Room for one more record. */
static bool make_room(clt_index *index, long *room) {
  if (index->count < *room) {
    return true;
  }
  *room = *room == 0 ? 64 : 2 * *room;
  clt_record *more = realloc(index->record, (size_t)*room * sizeof *more);
  if (more != NULL) {
    index->record = more;
  }
  return more != NULL;
}

static clt_status read_records(reader *r, clt_index *index, clt_error *error) {
  long room = 0;
  for (;;) {
    bool there;
    clt_status status = read_line(r, &there, error);
    if (status != CLT_OK || !there) {
      return status;
    }
    if (index->count == FRAMES_MAX || !make_room(index, &room)) {
      return clt_fail(error, CLT_FAILED, "%s: memory is short for more than %ld frames", r->path, index->count);
    }
    clt_record *record = &index->record[index->count];
    if (!take_record(r->line, record) || (index->count > 0 && record->pattern < record[-1].pattern)) {
      return fail_line(r, "no legal frame line", error);
    }
    index->count++;
  }
}

clt_status clt_index_read(const char *folder, clt_index *index, clt_error *error) {
  reader r = {0};
  *index = (clt_index){0};
  clt_status status = clt_index_path(folder, r.path, error);
  if (status != CLT_OK) {
    return status;
  }
  r.from = fopen(r.path, "re");
  if (r.from == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be opened: %s; a recording's folder holds it", r.path,
                    strerror(errno));
  }
  status = read_head(&r, index, error);
  if (status == CLT_OK) {
    status = read_records(&r, index, error);
  }
  fclose(r.from);
  if (status != CLT_OK) {
    clt_index_finish(index);
  }
  return status;
}

void clt_index_finish(clt_index *index) {
  free(index->record);
  *index = (clt_index){0};
}

/* Appends text as a whole or not at all. */
static clt_status append(int descriptor, const char *text, size_t length, clt_error *error) {
  off_t before = lseek(descriptor, 0, SEEK_END);
  ssize_t written = write(descriptor, text, length);
  if (written == (ssize_t)length && fsync(descriptor) == 0) {
    return CLT_OK;
  }
  int cause = written < 0 || written == (ssize_t)length ? errno : ENOSPC;
  if (before >= 0 && ftruncate(descriptor, before) != 0) {
    cause = errno;
  }
  return clt_fail(error, CLT_FAILED, "the recording's index cannot be written: %s", strerror(cause));
}

clt_status clt_index_create(const char *folder, const clt_projector_info *panel, const clt_camera_info *sensor,
                            int *descriptor, clt_error *error) {
  char path[CLT_PATH_MAX], head[2 * LINE_MAX_LENGTH];
  clt_status status = clt_index_path(folder, path, error);
  if (status != CLT_OK) {
    return status;
  }
  *descriptor = open(path, O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
  if (*descriptor < 0) {
    return clt_fail(error, errno == EEXIST ? CLT_BAD_INPUT : CLT_FAILED, "%s: %s; name another folder", path,
                    errno == EEXIST ? "there is a recording already" : strerror(errno));
  }
  int length = snprintf(head, sizeof head,
                        TITLE "\npanel %d %d %d %d %.17g\ncamera %d %d %d %d %.17g %.17g %.17g %.17g %.17g %.17g "
                              "%.17g %d %.17g\n",
                        panel->width, panel->height, panel->channels, panel->bits, panel->refresh_s, sensor->width,
                        sensor->height, sensor->channels, sensor->bits, sensor->frame_s, sensor->exposure_min_s,
                        sensor->exposure_max_s, sensor->black_level, sensor->responsivity, sensor->full_well,
                        sensor->read_noise, sensor->own_pixels, sensor->step);
  status = append(*descriptor, head, (size_t)length, error);
  if (status != CLT_OK) {
    close(*descriptor);
    unlink(path);
  }
  return status;
}

clt_status clt_index_append(int descriptor, const clt_record *record, clt_error *error) {
  char line[LINE_MAX_LENGTH];
  int length = snprintf(line, sizeof line, "frame %" PRIu32 " %ld %016" PRIx64 " %" PRId64 " %" PRId64 " %.17g %s\n",
                        record->sequence, record->pattern, record->hash, record->shown_ns, record->exposed_ns,
                        record->exposure_s, record->file);
  return append(descriptor, line, (size_t)length, error);
}

uint64_t clt_index_hash(const clt_projector_info *panel, const float *codes) {
  size_t values = (size_t)panel->width * (size_t)panel->height * (size_t)panel->channels;
  float full = (float)((1 << panel->bits) - 1);
  uint64_t hash = 0;
  for (size_t k = 0; k < values; k++) {
    float code = codes[k] > 0 ? codes[k] : 0; /* NaN is dark */
    hash = clt_random_scramble(hash + (uint64_t)lroundf(full * (code < 1 ? code : 1)) + 1);
  }
  return hash;
}
