/* Folders of results, and the scenes that come with counterlight. */
#ifndef CLT_CLI_FOLDER_H
#define CLT_CLI_FOLDER_H

#include "counterlight/status.h"

/* Takes the folder that --output names (NULL: fallback) into out (CLT_PATH_MAX), without a slash at its end.
 * CLT_BAD_INPUT where it is no folder, or can neither be made nor be written to: said before the work begins. */
clt_status cli_folder_choose(const char *given, const char *fallback, char *out, clt_error *error);
/* Makes the folder where it is not there. */
clt_status cli_folder_make(const char *folder, clt_error *error);

/* The folder of the shipped scenes: the source tree's first, for there a newly built program finds its own. */
clt_status cli_scenes_folder(const char **out, clt_error *error);

#endif
