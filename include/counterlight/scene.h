/* Scenes: the simulated room, its projector and its camera. A scene stands behind the same device tables as hardware
 * does; what is exact about it (its transport, its light) is for tests, references and reports only. */
#ifndef COUNTERLIGHT_SCENE_H
#define COUNTERLIGHT_SCENE_H

#include <stdbool.h>
#include <stddef.h>

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
 * with margin; not which pixel sees what, so that a rig on a camera with pixels of its own still has to be calibrated.
 */
CLT_PUBLIC void clt_scene_rig_config(const clt_scene *scene, clt_rig_config *config);
/* The exact radiance of every grid cell under a steady drive, black included: b0 + T drive, with what the scene does to
 * the drive before (crosstalk, defocus) and to the radiance after it (subsurface). What changes with time and what the
 * camera does is left out. radiance is initialised here. */
CLT_PUBLIC clt_status clt_scene_appearance(const clt_scene *scene, const clt_image *drive, clt_image *radiance,
                                           clt_error *error);

/* How far the simulated light of some cells is from their exact light, over all channels. */
typedef struct clt_reference {
  int cells;      /* that were compared */
  double rms;     /* of the difference, relative to the rms of the exact light */
  double largest; /* difference, relative to the same */
  double bound;   /* that the rms of the light's own error cannot exceed, given the differences found */
} clt_reference;
/* Compares T drive, as the scene computes it, with exactly computed rows at `cells` cells spread over the grid
 * (fewer where the grid has fewer). Small scenes: rows of T in double. Large ones, whose exchange of light is held
 * approximately: the light that reaches what the cell shows is gathered from every element of the scene, each by its
 * form factor and visibility in double; the difference r is the residual of the light equation, and bounds the light's
 * own error by r / (1 - m), m the greatest albedo. CLT_BAD_INPUT for a scene of a transport file, and for glossy light
 * of a large one. Takes about a second for every three cells of a grid of 512 x 256. Call it while no device of the
 * scene is in use. */
CLT_PUBLIC clt_status clt_scene_reference(const clt_scene *scene, const clt_image *drive, int cells, clt_reference *out,
                                          clt_error *error);

/* Radiance of a scene's surface elements where every one of them glows with radiance 1. */
typedef struct clt_furnace {
  int elements;           /* of the surfaces that exchange light */
  double least, greatest; /* radiance of an element */
} clt_furnace;
/* The furnace test of how a scene exchanges light: B = 1 + albedo G B, solved exactly in double, with the same albedo
 * (0 to below 1) on every surface in place of its own. In a closed room B is 1 / (1 - albedo) everywhere, whatever its
 * shape; where light escapes it is less, and nowhere more. CLT_BAD_INPUT for a scene of a transport file and for one
 * whose surfaces exchange no light. Meshes the scene anew as a small one is, whatever its grid; at most some seconds.
 */
CLT_PUBLIC clt_status clt_scene_furnace(const clt_scene *scene, double albedo, clt_furnace *out, clt_error *error);

enum { CLT_EFFECTS = 22, CLT_EFFECT_WHY_MAX = 160 };
/* What the simulation does about one effect in one scene. */
typedef struct clt_effect_report {
  const char *name;             /* "interreflection", "noise", ...: docs/simulator.md lists them */
  bool on;                      /* the scene calls for it */
  char why[CLT_EFFECT_WHY_MAX]; /* or why not, in words */
  double prepare_ms;            /* that opening the scene took for it */
  double frame_ms;              /* that it takes of a frame (of a new pattern, for what happens to light), measured */
  size_t bytes;                 /* of memory that it holds */
} clt_effect_report;
/* Every effect that a scene may call for, in the order in which light meets them; one that is off costs nothing. Runs
 * each a few times to measure it: call it while no device of the scene is in use. */
CLT_PUBLIC clt_status clt_scene_effects(clt_scene *scene, clt_effect_report reports[CLT_EFFECTS], clt_error *error);

/* What a camera with pixels of its own sees, in shares of its image that add up to 1; all zeros for one whose pixels
 * are the grid's, k x k a cell. */
typedef struct clt_pixels_report {
  bool own;
  double lit;        /* surfaces where the projector lights them */
  double shadowed;   /* surfaces in its picture that it does not reach */
  double outside;    /* surfaces beyond its picture */
  double nothing;    /* no surface, or the black back of one */
  double prepare_ms; /* that opening the scene took for tracing the pixels */
  double frame_ms;   /* that their light takes of a frame, measured */
  size_t bytes;      /* of memory that it holds */
} clt_pixels_report;
/* Measures: call it while no device of the scene is in use. */
CLT_PUBLIC clt_status clt_scene_pixels(const clt_scene *scene, clt_pixels_report *report, clt_error *error);
/* The true geometry of a camera with pixels of its own, for tests and references only, of what the middle of each of
 * its pixels sees: channel 0 of map is x and channel 1 is y of the place in the projector's picture, in cells from its
 * left and its top (cell k spans k to k + 1), NaN where the projector does not light what is seen; channel 2 is 1 where
 * it does, 0 where nothing is seen, 2 for a shadow, 3 beyond the projector's picture. map is initialised here.
 * CLT_BAD_INPUT for a camera whose pixels are the grid's. */
CLT_PUBLIC clt_status clt_scene_pixel_map(const clt_scene *scene, clt_image *map, clt_error *error);

/* The scene's projector and camera. One of each may be open at a time; both live in the scene's simulated time, which
 * moves on only when one of them is asked for something. The same seed gives the same frames. */
CLT_PUBLIC clt_status clt_scene_open_projector(clt_scene *scene, clt_projector **out, clt_error *error);
CLT_PUBLIC clt_status clt_scene_open_camera(clt_scene *scene, clt_camera **out, clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
