/* The index of a recording: what replay.h describes, as text and in memory. */
#ifndef CLT_DEVICE_REPLAY_INDEX_H
#define CLT_DEVICE_REPLAY_INDEX_H

#include <stdint.h>

#include "counterlight/device.h"

enum { CLT_RECORD_FILE = 32 };

/* One line. */
typedef struct clt_record {
  uint32_t sequence;
  long pattern;
  uint64_t hash;
  int64_t shown_ns, exposed_ns;
  double exposure_s;
  char file[CLT_RECORD_FILE]; /* a plain name within the folder */
} clt_record;

/* Zeroed it is valid and empty. */
typedef struct clt_index {
  clt_projector_info panel;
  clt_camera_info sensor;
  long count;
  clt_record *record; /* patterns do not descend */
} clt_index;

/* folder/index.txt; out has room for CLT_PATH_MAX. */
clt_status clt_index_path(const char *folder, char *out, clt_error *error);
/* Reads a whole index. CLT_BAD_INPUT with file and line where something is wrong with it. */
clt_status clt_index_read(const char *folder, clt_index *index, clt_error *error);
void clt_index_finish(clt_index *index);

/* Starts the index of a folder: a file of the devices' properties, opened to append to. CLT_BAD_INPUT where there is
 * one. */
clt_status clt_index_create(const char *folder, const clt_projector_info *panel, const clt_camera_info *sensor,
                            int *descriptor, clt_error *error);
/* Appends one line and brings it to the disk; where that fails the index keeps its whole lines. */
clt_status clt_index_append(int descriptor, const clt_record *record, clt_error *error);

/* Of a picture's codes, rounded to the panel's bits. */
uint64_t clt_index_hash(const clt_projector_info *panel, const float *codes);

#endif
