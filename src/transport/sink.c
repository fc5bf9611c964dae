#include "transport/sink.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"

/* HDF5's view of the file: its end as HDF5 has allocated it, and as it has been written. */
typedef struct sink_file {
  H5FD_t base;
  clt_sink *sink;
  haddr_t allocated, written;
} sink_file;

typedef struct sink_target {
  clt_sink *sink;
} sink_target;

static H5FD_t *sink_open(const char *name, unsigned flags, hid_t access, haddr_t most) {
  (void)name;
  (void)flags;
  (void)most;
  const sink_target *target = H5Pget_driver_info(access);
  sink_file *file = clt_alloc(1, sizeof *file);
  if (target == NULL || file == NULL) {
    free(file);
    return NULL;
  }
  file->sink = target->sink;
  return &file->base;
}

static herr_t sink_close(H5FD_t *base) {
  free(base);
  return 0;
}

static herr_t sink_query(const H5FD_t *base, unsigned long *flags) {
  (void)base;
  *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
           H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

static haddr_t sink_allocated(const H5FD_t *base, H5FD_mem_t type) {
  (void)type;
  return ((const sink_file *)base)->allocated;
}

static herr_t sink_allocate(H5FD_t *base, H5FD_mem_t type, haddr_t end) {
  (void)type;
  ((sink_file *)base)->allocated = end;
  return 0;
}

static haddr_t sink_written(const H5FD_t *base, H5FD_mem_t type) {
  (void)type;
  return ((const sink_file *)base)->written;
}

/* What was never written, or was lost, reads as zeros. */
static herr_t sink_read(H5FD_t *base, H5FD_mem_t type, hid_t transfer, haddr_t address, size_t size, void *buffer) {
  (void)type;
  (void)transfer;
  const clt_sink *sink = ((sink_file *)base)->sink;
  memset(buffer, 0, size);
  for (size_t done = 0; done < size;) {
    ssize_t more = pread(sink->descriptor, (char *)buffer + done, size - done, (off_t)(address + done));
    if (more < 0 && errno == EINTR) {
      continue;
    }
    if (more <= 0) {
      break;
    }
    done += (size_t)more;
  }
  return 0;
}

static herr_t sink_write(H5FD_t *base, H5FD_mem_t type, hid_t transfer, haddr_t address, size_t size,
                         const void *buffer) {
  (void)type;
  (void)transfer;
  sink_file *file = (sink_file *)base;
  clt_sink *sink = file->sink;
  for (size_t done = 0; done < size && sink->failure == 0;) {
    ssize_t more = pwrite(sink->descriptor, (const char *)buffer + done, size - done, (off_t)(address + done));
    if (more >= 0) {
      done += (size_t)more;
    } else if (errno != EINTR) {
      sink->failure = errno;
    }
  }
  file->written = address + size > file->written ? address + size : file->written;
  return 0;
}

static herr_t sink_truncate(H5FD_t *base, hid_t transfer, hbool_t closing) {
  (void)transfer;
  (void)closing;
  sink_file *file = (sink_file *)base;
  if (file->sink->failure == 0 && ftruncate(file->sink->descriptor, (off_t)file->allocated) != 0) {
    file->sink->failure = errno;
  }
  file->written = file->allocated;
  return 0;
}

static const H5FD_class_t sink_class = {.name = "counterlight sink",
                                        .maxaddr = INT64_MAX,
                                        .fc_degree = H5F_CLOSE_WEAK,
                                        .fapl_size = sizeof(sink_target),
                                        .open = sink_open,
                                        .close = sink_close,
                                        .query = sink_query,
                                        .get_eoa = sink_allocated,
                                        .set_eoa = sink_allocate,
                                        .get_eof = sink_written,
                                        .read = sink_read,
                                        .write = sink_write,
                                        .truncate = sink_truncate,
                                        .fl_map = H5FD_FLMAP_DICHOTOMY};

/* The format of HDF5 1.8 has check sums over a file's structure, which the older one, HDF5's default, has not. */
hid_t clt_sink_create(clt_sink *sink, const char *name) {
  const sink_target target = {sink};
  hid_t driver = sink->driver = H5FDregister(&sink_class);
  hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  hid_t file = H5I_INVALID_HID;
  if (driver >= 0 && access >= 0 && H5Pset_driver(access, driver, &target) >= 0 &&
      H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_V18) >= 0) {
    file = H5Fcreate(name, H5F_ACC_TRUNC, H5P_DEFAULT, access);
  }
  if (access >= 0) {
    H5Pclose(access);
  }
  return file;
}

void clt_sink_finish(clt_sink *sink) {
  if (sink->driver >= 0) {
    H5FDunregister(sink->driver);
  }
  sink->driver = H5I_INVALID_HID;
}
