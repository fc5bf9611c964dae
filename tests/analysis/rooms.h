/* Simulated rooms of this folder's tests, written as scene files. */
#ifndef CLT_TESTS_ANALYSIS_ROOMS_H
#define CLT_TESTS_ANALYSIS_ROOMS_H

#include "counterlight/scene.h"
#include "counterlight/station.h"
#include "cube.h"

/* A scene file in a folder of its own, opened. */
typedef struct room {
  char folder[64], path[96];
  clt_scene *scene;
  const clt_transport *transport;
  clt_certificate *certificate;
  size_t cells;
} room;

static inline room room_write(const char *text) {
  room made = {0};
  test_folder(made.folder);
  snprintf(made.path, sizeof made.path, "%s/room.cfg", made.folder);
  FILE *file = fopen(made.path, "w");
  assert_non_null(file);
  fputs(text, file);
  fclose(file);
  return made;
}

static inline void room_open(room *made) {
  clt_error error = {0};
  assert_ok(clt_scene_open(made->path, &made->scene, &error), error);
  made->transport = clt_scene_transport(made->scene);
  made->cells = clt_transport_describe(made->transport).cols;
  assert_ok(clt_certify(made->transport, &made->certificate, &error), error);
}

static inline void room_close(room *made) {
  clt_certificate_destroy(made->certificate);
  clt_scene_close(made->scene);
  unlink(made->path);
  rmdir(made->folder);
}

/* The walls of config/scenes/dihedral.cfg, one channel. tangent: of the lens; [0.44, 0.33] there, which leaves the
 * upper and lower part of the walls unlit; [0.65, 0.85] lights them whole. */
static inline const char *dihedral_text(char text[2048], int width, int height, const char *tangent,
                                        const double albedo[2], const char *more) {
  snprintf(text, 2048,
           "grid = { width = %d; height = %d; channels = 1; };\n"
           "projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = %s; intensity = 40.0; };\n"
           "materials = ( { name = \"left\"; albedo = %.9g; }, { name = \"right\"; albedo = %.9g; } );\n"
           "surfaces = (\n"
           "  { corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"left\"; },\n"
           "  { corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"right\"; }\n"
           ");\n%s",
           width, height, tangent, albedo[0], albedo[1], more);
  return text;
}

#endif
