/* Reading and writing HDF5 with its sizes checked and its errors put into words.
 *
 * Every function here needs the lock of clt_hdf_enter, which also keeps HDF5 from printing. */
#ifndef CLT_TRANSPORT_HDF_H
#define CLT_TRANSPORT_HDF_H

#include <hdf5.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"
#include "transport/sink.h"

/* A file under way, with the path that messages name. It stays where it is while it is open. */
typedef struct clt_hdf {
  hid_t file;
  const char *path;
  clt_sink sink; /* of a file that is being written */
} clt_hdf;

/* What clt_hdf_leave gives back to the rest of the process. */
typedef struct clt_hdf_session {
  H5E_auto2_t print;
  void *context;
} clt_hdf_session;

clt_hdf_session clt_hdf_enter(void);
void clt_hdf_leave(clt_hdf_session session);

/* Opens a file for reading; CLT_BAD_INPUT says whether it is missing, no file, no HDF5 or damaged. */
clt_status clt_hdf_open(const char *path, clt_hdf *hdf, clt_error *error);
/* Creates the file `path`, which must not be there yet; messages name it `label`. Then clt_hdf_complete is to come. */
clt_status clt_hdf_create(const char *path, const char *label, clt_hdf *hdf, clt_error *error);
void clt_hdf_close(clt_hdf *hdf); /* accepts one that is not open */
/* Brings a created file out and closes it; status is what became of writing it so far. Where that or this failed, the
 * file's content is not to be used. */
clt_status clt_hdf_complete(clt_hdf *hdf, clt_status status, clt_error *error);

/* Whether a path such as "/tree/start" (and each group on its way) is there. */
bool clt_hdf_has(const clt_hdf *hdf, const char *name);
/* Whether a dataset is there and not declared empty (h5py.Empty). */
bool clt_hdf_has_values(const clt_hdf *hdf, const char *name);
clt_status clt_hdf_make_group(const clt_hdf *hdf, const char *name, clt_error *error);

/* Fail with HDF5's own account of why `name` could not be read or written. */
clt_status clt_hdf_refuse_read(const clt_hdf *hdf, const char *name, clt_error *error);
clt_status clt_hdf_refuse_write(const clt_hdf *hdf, const char *name, clt_error *error);
/* Fails where values of the type cannot be converted to numbers. */
clt_status clt_hdf_require_numbers(const clt_hdf *hdf, const char *name, hid_t type, clt_error *error);

/* The type of IEEE half-precision numbers in this machine's byte order; the caller closes it. */
hid_t clt_hdf_half(void);

#define CLT_HDF_ANY SIZE_MAX

/* A dataset on its way between file and memory, C order. */
typedef struct clt_hdf_array {
  const char *name;
  hid_t type;      /* of an element in memory: H5T_NATIVE_FLOAT, H5T_NATIVE_INT64, ... */
  int rank;        /* 1..3 */
  size_t shape[3]; /* the first rank sizes; before reading, CLT_HDF_ANY leaves one open */
  void *data;      /* after reading: from clt_alloc, owned by the caller */
} clt_hdf_array;

/* Reads a dataset of numbers of any width, converted to array->type. Rank, sizes and what the file really holds are
 * checked before memory is taken. On failure data is NULL. */
clt_status clt_hdf_read(const clt_hdf *hdf, clt_hdf_array *array, clt_error *error);
/* Creates the dataset and writes it as array->type. */
clt_status clt_hdf_write(const clt_hdf *hdf, const clt_hdf_array *array, clt_error *error);

/* Attributes of the root. Reading gives CLT_OK and leaves the value alone where the attribute is absent or empty. */
/* A number of any integer or float type, scalar or an array of one. */
clt_status clt_hdf_read_number(const clt_hdf *hdf, const char *name, double *value, clt_error *error);
/* A string of fixed or variable length, UTF-8 or ASCII; clipped to size - 1 bytes and always terminated. */
clt_status clt_hdf_read_text(const clt_hdf *hdf, const char *name, char *text, size_t size, clt_error *error);
/* type is the type of *value: H5T_NATIVE_INT, H5T_NATIVE_INT64 or H5T_NATIVE_DOUBLE. */
clt_status clt_hdf_write_number(const clt_hdf *hdf, const char *name, hid_t type, const void *value, clt_error *error);
clt_status clt_hdf_write_text(const clt_hdf *hdf, const char *name, const char *text, clt_error *error);

#endif
