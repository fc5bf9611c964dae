/* Names of the pictures of an image list. */
#ifndef CLT_DEVICE_REPLAY_NAMES_H
#define CLT_DEVICE_REPLAY_NAMES_H

#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Paths, malloc'ed one by one, as is the array. A zeroed one is empty. */
typedef struct clt_names {
  int count;
  char **path;
} clt_names;

/* What a path stands for as clt_replay_open_pictures says; CLT_BAD_INPUT where that is no picture at all. */
clt_status clt_names_find(const char *path, clt_names *names, clt_error *error);
/* Adds a name of a folder. */
clt_status clt_names_add(clt_names *names, const char *folder, const char *name, clt_error *error);
void clt_names_finish(clt_names *names);

/* The texts of the first sequence of texts in a file of OpenCV's FileStorage. */
clt_status clt_opencv_read_names(const char *path, const char *folder, clt_names *names, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
