/* Whether a PLY file is whole. */
#ifndef CLT_SIM_PLY_FILE_H
#define CLT_SIM_PLY_FILE_H

#include "counterlight/status.h"

/* CLT_BAD_INPUT where the file (Turk 1994, the Stanford PLY format) is shorter than its header says: readers may guess
 * the rest, or take memory for it. Says nothing of files that do not begin as a PLY file does. The message lacks the
 * path. */
clt_status clt_ply_check(const char *path, clt_error *error);

#endif
