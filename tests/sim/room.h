/* Scenes that the tests of the simulator make up. */
#ifndef CLT_TESTS_SIM_ROOM_H
#define CLT_TESTS_SIM_ROOM_H

#include "counterlight/scene.h"
#include "sim/description.h"
#include "support.h"

/* A scene file and perhaps a transport beside it, in a folder of their own. */
typedef struct room {
  char folder[64], scene_path[96], transport_path[96];
} room;

void room_make(room *made, const char *scene_text);
/* Saves T (channels x cells x cells, from entry) and a black as "t.h5" in the room's folder. */
void room_add_transport(const room *made, int width, int height, int channels,
                        float (*entry)(int channel, size_t row, size_t column), float black);
void room_remove(const room *made);
/* Opens the room's scene or fails the test. */
clt_scene *room_open(const room *made);

/* The repository's data folder beside it, or NULL where it is not there. */
const char *shared_file(const char *name, char path[1024]);

/* A description without a file: grid, rays, projector looking from position to target with up = z, intensity 10; the
 * test finishes it. */
void describe_view(clt_scene_description *description, int width, int height, clt_vector position, clt_vector target);
void add_surface(clt_scene_description *description, clt_vector corner, clt_vector u, clt_vector v, double albedo);

#endif
