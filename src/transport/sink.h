/* Where HDF5 writes a new file: an HDF5 file driver that keeps the first failure to itself.
 *
 * HDF5 cannot let go of a file that it failed to write: closing fails too, and the library crashes when the process
 * ends. So a full disk is not reported to HDF5 but to the caller, who throws the file away. */
#ifndef CLT_TRANSPORT_SINK_H
#define CLT_TRANSPORT_SINK_H

#include <hdf5.h>

typedef struct clt_sink {
  int descriptor; /* of a new, empty file, open for reading and writing; the caller's */
  int failure;    /* errno of the first write that failed, 0 so far: then nothing more is written */
} clt_sink;

/* Creates the HDF5 file that is written to sink, which must outlive it. `name` is for HDF5's messages only. */
hid_t clt_sink_create(clt_sink *sink, const char *name);

#endif
