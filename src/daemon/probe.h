/* Trying a stored transport in a process of its own: HDF5 does not survive every damaged file. */
#ifndef CLT_DAEMON_PROBE_H
#define CLT_DAEMON_PROBE_H

#include <stdbool.h>

/* Runs this program with --try-transport on the file. False where reading it crashed, or took longer than any whole
 * file does; true where it ended by itself, whatever it found, and where no process can be had. */
bool probe_transport(const char *path);

/* What --try-transport does: loads the file. Exit code 0 where that succeeds, else 2. */
int probe_run(const char *path);

#endif
