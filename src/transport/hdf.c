#include "transport/hdf.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/memory.h"

/* Debian's HDF5 is built without thread safety and keeps global state of its own: one call at a time in this process,
 * whichever transport it is for. Hence the one static that is not a constant. */
static pthread_mutex_t hdf_lock = PTHREAD_MUTEX_INITIALIZER;

clt_hdf_session clt_hdf_enter(void) {
  clt_hdf_session session;
  pthread_mutex_lock(&hdf_lock);
  H5Eget_auto2(H5E_DEFAULT, &session.print, &session.context);
  H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
  return session;
}

void clt_hdf_leave(clt_hdf_session session) {
  H5Eset_auto2(H5E_DEFAULT, session.print, session.context);
  pthread_mutex_unlock(&hdf_lock);
}

/* Keeps the first, innermost line of HDF5's error stack. */
static herr_t take_innermost(unsigned index, const H5E_error2_t *entry, void *context) {
  if (index == 0 && entry->desc != NULL) {
    char *text = context;
    strncat(text, entry->desc, CLT_MESSAGE_MAX - 1);
  }
  return 0;
}

/* HDF5's own account of its last failure, shortened to the system's message where it has one. */
static void find_cause(char cause[CLT_MESSAGE_MAX]) {
  static const char marker[] = "error message = '";
  cause[0] = '\0';
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take_innermost, cause);
  char *system = strstr(cause, marker);
  if (system != NULL) {
    system += sizeof marker - 1;
    system[strcspn(system, "'")] = '\0';
    memmove(cause, system, strlen(system) + 1);
  }
  if (cause[0] == '\0') {
    strcpy(cause, "HDF5 does not say why");
  }
}

clt_status clt_hdf_refuse_read(const clt_hdf *hdf, const char *name, clt_error *error) {
  char cause[CLT_MESSAGE_MAX];
  find_cause(cause);
  return clt_fail(error, CLT_BAD_INPUT, "%s: %s cannot be read (%.120s): the file is damaged, write it again",
                  hdf->path, name, cause);
}

clt_status clt_hdf_refuse_write(const clt_hdf *hdf, const char *name, clt_error *error) {
  char cause[CLT_MESSAGE_MAX];
  find_cause(cause);
  return clt_fail(error, CLT_FAILED, "%s: %s cannot be written: %.120s", hdf->path, name, cause);
}

clt_status clt_hdf_open(const char *path, clt_hdf *hdf, clt_error *error) {
  *hdf = (clt_hdf){.file = H5I_INVALID_HID, .path = path};
  struct stat about;
  if (stat(path, &about) != 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be opened: %s", path, strerror(errno));
  }
  if (!S_ISREG(about.st_mode)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is not a file; give the name of a transport file", path);
  }
  if (H5Fis_hdf5(path) == 0) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: is no HDF5 file; `counterlight acquire` writes transport files", path);
  }
  hdf->file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
  if (hdf->file < 0) {
    char cause[CLT_MESSAGE_MAX];
    find_cause(cause);
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be opened (%.120s): copy or write it again", path, cause);
  }
  return CLT_OK;
}

clt_status clt_hdf_create(const char *path, const char *label, clt_hdf *hdf, clt_error *error) {
  *hdf = (clt_hdf){.file = H5I_INVALID_HID, .path = label};
  hdf->sink.descriptor = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (hdf->sink.descriptor < 0) {
    return clt_fail(error, CLT_FAILED, "%s: cannot be created: %s", label, strerror(errno));
  }
  hdf->file = clt_sink_create(&hdf->sink, label);
  if (hdf->file < 0) {
    clt_sink_finish(&hdf->sink);
    close(hdf->sink.descriptor);
    return clt_hdf_refuse_write(hdf, "the file", error);
  }
  return CLT_OK;
}

void clt_hdf_close(clt_hdf *hdf) {
  if (hdf->file >= 0) {
    H5Fclose(hdf->file);
  }
  hdf->file = H5I_INVALID_HID;
}

clt_status clt_hdf_complete(clt_hdf *hdf, clt_status status, clt_error *error) {
  if (H5Fclose(hdf->file) < 0 && status == CLT_OK) {
    status = clt_hdf_refuse_write(hdf, "the end of the file", error);
  }
  hdf->file = H5I_INVALID_HID;
  clt_sink_finish(&hdf->sink);
  if (close(hdf->sink.descriptor) != 0 && hdf->sink.failure == 0) {
    hdf->sink.failure = errno;
  }
  if (hdf->sink.failure != 0) {
    status = clt_fail(error, CLT_FAILED,
                      "%s: cannot be written: %s; make room and try again (what was there before "
                      "is unchanged)",
                      hdf->path, strerror(hdf->sink.failure));
  }
  return status;
}

bool clt_hdf_has(const clt_hdf *hdf, const char *name) {
  char part[64];
  for (const char *slash = strchr(name + 1, '/'); slash != NULL; slash = strchr(slash + 1, '/')) {
    size_t length = (size_t)(slash - name);
    if (length >= sizeof part) {
      return false;
    }
    memcpy(part, name, length);
    part[length] = '\0';
    if (H5Lexists(hdf->file, part, H5P_DEFAULT) <= 0) {
      return false;
    }
  }
  return H5Lexists(hdf->file, name, H5P_DEFAULT) > 0;
}

bool clt_hdf_has_values(const clt_hdf *hdf, const char *name) {
  if (!clt_hdf_has(hdf, name)) {
    return false;
  }
  hid_t set = H5Dopen2(hdf->file, name, H5P_DEFAULT);
  hid_t space = set < 0 ? H5I_INVALID_HID : H5Dget_space(set);
  bool empty = space >= 0 && H5Sget_simple_extent_type(space) == H5S_NULL;
  if (space >= 0) {
    H5Sclose(space);
  }
  if (set >= 0) {
    H5Dclose(set);
  }
  return !empty;
}

hid_t clt_hdf_half(void) {
  hid_t half = H5Tcopy(H5T_NATIVE_FLOAT);
  H5Tset_fields(half, 15, 10, 5, 0, 10);
  H5Tset_size(half, 2);
  H5Tset_ebias(half, 15);
  return half;
}

clt_status clt_hdf_make_group(const clt_hdf *hdf, const char *name, clt_error *error) {
  hid_t group = H5Gcreate2(hdf->file, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  if (group < 0) {
    return clt_hdf_refuse_write(hdf, name, error);
  }
  H5Gclose(group);
  return CLT_OK;
}

/* Writes "[1, 768, 768]". */
static void format_shape(int rank, const size_t *shape, char text[96]) {
  int used = snprintf(text, 96, "[");
  for (int axis = 0; axis < rank; axis++) {
    used += shape[axis] == CLT_HDF_ANY
                ? snprintf(text + used, 96 - (size_t)used, "%sany", axis == 0 ? "" : ", ")
                : snprintf(text + used, 96 - (size_t)used, "%s%zu", axis == 0 ? "" : ", ", shape[axis]);
  }
  snprintf(text + used, 96 - (size_t)used, "]");
}

/* Compares the dataset's shape with the wanted one and fills in the sizes that were left open. */
static clt_status match_shape(const clt_hdf *hdf, clt_hdf_array *array, hid_t space, clt_error *error) {
  hsize_t found[H5S_MAX_RANK] = {0};
  int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 0 || H5Sget_simple_extent_dims(space, found, NULL) < 0) {
    return clt_hdf_refuse_read(hdf, array->name, error);
  }
  bool fits = rank == array->rank;
  for (int axis = 0; fits && axis < rank; axis++) {
    fits = array->shape[axis] == CLT_HDF_ANY || array->shape[axis] == found[axis];
  }
  if (!fits) {
    char wanted[96], have[96];
    size_t shape[3] = {found[0], found[1], found[2]};
    format_shape(array->rank, array->shape, wanted);
    format_shape(rank < 3 ? rank : 3, shape, have);
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s has the shape %s in %d dimension(s), wanted %s: %s", hdf->path,
                    array->name, have, rank, wanted, "its sizes must agree with width, height, channels and rows");
  }
  for (int axis = 0; axis < rank; axis++) {
    array->shape[axis] = found[axis];
  }
  return CLT_OK;
}

/* Bytes that the array takes in memory; refused where that is more than the file can possibly hold. Deflate packs at
 * most 1032:1, and a small dataset may never have been written (it reads as zeros). */
static clt_status measure(const clt_hdf *hdf, const clt_hdf_array *array, hid_t set, size_t *count, clt_error *error) {
  const size_t unwritten = (size_t)64 << 20, packing = 1040;
  size_t element = H5Tget_size(array->type), total = 1;
  bool fits = true;
  for (int axis = 0; axis < array->rank; axis++) {
    fits = fits && !__builtin_mul_overflow(total, array->shape[axis], &total);
  }
  hsize_t stored = H5Dget_storage_size(set);
  if (!fits || total > SIZE_MAX / element || total * element / packing > stored + unwritten / packing) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s claims more values than the file holds; write it again", hdf->path,
                    array->name);
  }
  *count = total;
  return CLT_OK;
}

clt_status clt_hdf_require_numbers(const clt_hdf *hdf, const char *name, hid_t type, clt_error *error) {
  H5T_class_t kind = H5Tget_class(type);
  if (kind != H5T_FLOAT && kind != H5T_INTEGER) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: %s does not hold numbers; write it as float32 or integers", hdf->path,
                    name);
  }
  return CLT_OK;
}

static clt_status read_set(const clt_hdf *hdf, clt_hdf_array *array, hid_t set, clt_error *error) {
  hid_t space = H5Dget_space(set), type = H5Dget_type(set);
  size_t count = 0;
  clt_status status = clt_hdf_require_numbers(hdf, array->name, type, error);
  if (status == CLT_OK) {
    status = match_shape(hdf, array, space, error);
  }
  if (status == CLT_OK) {
    status = measure(hdf, array, set, &count, error);
  }
  if (status == CLT_OK) {
    array->data = clt_alloc(count, H5Tget_size(array->type));
    if (array->data == NULL) {
      status = clt_fail(error, CLT_FAILED, "%s: no memory for the %zu values of %s", hdf->path, count, array->name);
    } else if (H5Dread(set, array->type, H5S_ALL, H5S_ALL, H5P_DEFAULT, array->data) < 0) {
      status = clt_hdf_refuse_read(hdf, array->name, error);
    }
  }
  H5Tclose(type);
  H5Sclose(space);
  return status;
}

clt_status clt_hdf_read(const clt_hdf *hdf, clt_hdf_array *array, clt_error *error) {
  array->data = NULL;
  if (!clt_hdf_has(hdf, array->name)) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: the dataset %s is missing", hdf->path, array->name);
  }
  hid_t set = H5Dopen2(hdf->file, array->name, H5P_DEFAULT);
  if (set < 0) {
    return clt_hdf_refuse_read(hdf, array->name, error);
  }
  clt_status status = read_set(hdf, array, set, error);
  H5Dclose(set);
  if (status != CLT_OK) {
    free(array->data);
    array->data = NULL;
  }
  return status;
}

clt_status clt_hdf_write(const clt_hdf *hdf, const clt_hdf_array *array, clt_error *error) {
  hsize_t shape[3] = {array->shape[0], array->shape[1], array->shape[2]};
  hid_t space = H5Screate_simple(array->rank, shape, NULL);
  hid_t set = H5Dcreate2(hdf->file, array->name, array->type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  bool done = set >= 0 && H5Dwrite(set, array->type, H5S_ALL, H5S_ALL, H5P_DEFAULT, array->data) >= 0;
  clt_status status = done ? CLT_OK : clt_hdf_refuse_write(hdf, array->name, error);
  if (set >= 0 && H5Dclose(set) < 0 && done) {
    status = clt_hdf_refuse_write(hdf, array->name, error);
  }
  H5Sclose(space);
  return status;
}
