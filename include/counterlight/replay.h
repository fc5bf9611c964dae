/* Recorded and replayed devices: frames kept in a folder while they are used, and served again without the room.
 *
 * A recording is a folder with a text file `index.txt` and one 16 bit PNG a frame. The index begins with the devices'
 * properties and has one line a frame:
 *   frame SEQUENCE PATTERN HASH SHOWN_NS EXPOSED_NS EXPOSURE_S FILE
 * SEQUENCE the camera's own count, PATTERN the number of pictures presented until then (from 1), HASH of that picture's
 * codes k, rounded to the panel's bits (h = splitmix64's finaliser of h + k + 1, from 0), SHOWN_NS when it was shown,
 * the rest as in clt_frame. */
#ifndef COUNTERLIGHT_REPLAY_H
#define COUNTERLIGHT_REPLAY_H

#include <stdbool.h>

#include "counterlight/device.h"
#include "counterlight/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Puts a recorder between a program and its devices. *recorded_projector and *recorded_camera behave as projector and
 * camera, which they use and which must outlive them, and every frame that the camera hands out is on the disk before
 * the caller gets it. Closing them closes neither projector nor camera; either may be closed first. folder is made; one
 * that holds a recording already is refused (CLT_BAD_INPUT). Where a frame cannot be kept, as on a full disk, the
 * camera's next fails with CLT_FAILED and what is in the folder stays a whole recording. */
CLT_PUBLIC clt_status clt_recording_open(const char *folder, clt_projector *projector, clt_camera *camera,
                                         clt_projector **recorded_projector, clt_camera **recorded_camera,
                                         clt_error *error);

/* Opens a recording as a pair of devices. Pictures must be presented in the recorded order: present fails with
 * CLT_BAD_INPUT where the codes are not those of the recording, and with CLT_GONE after its last picture. next serves
 * the frames of the picture presented last, in order, leaves out those before not_before_ns, and fails with CLT_TIMEOUT
 * where that picture has no more and with CLT_GONE where the recording has none. A damaged index or frame is
 * CLT_BAD_INPUT with file and line. Either device may be closed first. */
CLT_PUBLIC clt_status clt_replay_open(const char *folder, clt_projector **projector, clt_camera **camera,
                                      clt_error *error);
/* The longest exposure time among a recording's frames, s. CLT_BAD_INPUT as clt_replay_open, and where there is none.
 */
CLT_PUBLIC clt_status clt_replay_longest_exposure(const char *folder, double *seconds, clt_error *error);
/* True where the folder holds a recording. */
CLT_PUBLIC bool clt_replay_is_recording(const char *folder);

/* Opens pictures (PNG, JPEG) as the frames of a camera, one for each picture presented, in order; the projector takes
 * any picture. path is a list of names (OpenCV's FileStorage: YAML, XML or JSON with one sequence of texts; relative to
 * its folder), or a folder: its list.yaml, or else all its pictures in the order of their names. Nothing is known of
 * exposure times: frames say that they had what was asked for. *pictures: their number. All must be of one size and
 * kind; what is not is found (CLT_BAD_INPUT) when its turn comes. */
CLT_PUBLIC clt_status clt_replay_open_pictures(const char *path, int panel_width, int panel_height,
                                               clt_projector **projector, clt_camera **camera, int *pictures,
                                               clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
