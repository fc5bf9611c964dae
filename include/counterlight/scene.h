/* Scenes: the simulated room, its projector and its camera. A scene stands behind the same device tables as hardware
 * does; what is exact about it (its transport, its light) is for tests, references and reports only. */
#ifndef COUNTERLIGHT_SCENE_H
#define COUNTERLIGHT_SCENE_H

#include "counterlight/device.h"
#include "counterlight/image.h"
#include "counterlight/rig.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A scene made ready: geometry, exact transport, simulated clock and the state of its projector and camera. */
typedef struct clt_scene clt_scene;

/* Reads a scene file (docs/scene-file.md, libconfig syntax) and computes its light. CLT_BAD_INPUT names file, line, key
 * and the legal range. */
CLT_PUBLIC clt_status clt_scene_open(const char *path, clt_scene **out, clt_error *error);
CLT_PUBLIC void clt_scene_close(clt_scene *scene); /* accepts NULL; after its devices are closed */

/* The scene's exact transport with its black b0 = ambient + what the projector's black level lights (owned by the
 * scene). Never read on the way from patterns to frames to the acquired T. */
CLT_PUBLIC const clt_transport *clt_scene_transport(const clt_scene *scene);
/* The rig settings that an installer would have measured on this scene: grid, response curves, exposures, a latency
 * with margin. */
CLT_PUBLIC void clt_scene_rig_config(const clt_scene *scene, clt_rig_config *config);
/* The exact radiance of every grid cell under a drive, black included: b0 + T drive. radiance is initialised here. */
CLT_PUBLIC clt_status clt_scene_appearance(const clt_scene *scene, const clt_image *drive, clt_image *radiance,
                                           clt_error *error);

/* The scene's projector and camera. One of each may be open at a time; both live in the scene's simulated time, which
 * moves on only when one of them is asked for something. The same seed gives the same frames. */
CLT_PUBLIC clt_status clt_scene_open_projector(clt_scene *scene, clt_projector **out, clt_error *error);
CLT_PUBLIC clt_status clt_scene_open_camera(clt_scene *scene, clt_camera **out, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
