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
  hid_t driver;   /* HDF5's number of the file driver */
} clt_sink;

/* Creates the HDF5 file that is written to sink, which must outlive it. `name` is for HDF5's messages only. Its caller
 * calls clt_sink_finish in either case. */
hid_t clt_sink_create(clt_sink *sink, const char *name);
/* After the file is closed: HDF5 1.10 reads the driver's functions once more after letting go of it, so that it must
 * not be the file that lets go of it last. */
void clt_sink_finish(clt_sink *sink);

#endif
