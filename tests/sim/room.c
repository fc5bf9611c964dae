#include "room.h"

void room_make(room *made, const char *scene_text) {
  test_folder(made->folder);
  snprintf(made->scene_path, sizeof made->scene_path, "%s/scene.cfg", made->folder);
  snprintf(made->transport_path, sizeof made->transport_path, "%s/t.h5", made->folder);
  FILE *file = fopen(made->scene_path, "w");
  assert_non_null(file);
  fputs(scene_text, file);
  fclose(file);
}

void room_add_transport(const room *made, int width, int height, int channels,
                        float (*entry)(int channel, size_t row, size_t column), float black) {
  clt_error error = {.status = CLT_OK};
  clt_transport *transport = NULL;
  size_t cells = (size_t)width * (size_t)height;
  assert_ok(clt_transport_create_dense(width, height, channels, cells, &transport, &error), error);
  for (int c = 0; c < channels; c++) {
    for (size_t i = 0; i < cells; i++) {
      clt_transport_black(transport, c)[i] = black;
      for (size_t j = 0; j < cells; j++) {
        clt_transport_entries(transport, c)[i * cells + j] = entry(c, i, j);
      }
    }
  }
  assert_ok(clt_transport_save(transport, made->transport_path, &error), error);
  clt_transport_destroy(transport);
}

void room_remove(const room *made) {
  unlink(made->scene_path);
  unlink(made->transport_path);
  rmdir(made->folder);
}

clt_scene *room_open(const room *made) {
  clt_error error = {.status = CLT_OK};
  clt_scene *scene = NULL;
  assert_ok(clt_scene_open(made->scene_path, &scene, &error), error);
  return scene;
}

const char *shared_file(const char *name, char path[1024]) {
  const char *folder = getenv("CLT_SHARED");
  snprintf(path, 1024, "%s/%s", folder != NULL ? folder : CLT_SOURCE_ROOT "/../shared", name);
  return access(path, R_OK) == 0 ? path : NULL;
}

void describe_view(clt_scene_description *description, int width, int height, clt_vector position, clt_vector target) {
  *description = (clt_scene_description){.path = "test", .width = width, .height = height, .channels = 1, .rays = 4};
  clt_pinhole *pinhole = &description->projector.pinhole;
  *pinhole = (clt_pinhole){.position = position, .tangent = {0.44, 0.33}};
  assert_true(clt_pinhole_aim(pinhole, target, (clt_vector){0.0, 0.0, 1.0}));
  for (int c = 0; c < CLT_SIM_CHANNELS_MAX; c++) {
    description->projector.intensity[c] = 10.0;
  }
}

void add_surface(clt_scene_description *description, clt_vector corner, clt_vector u, clt_vector v, double albedo) {
  assert_true(clt_scene_reserve_surfaces(description, 1));
  clt_rectangle *surface = &description->surfaces[description->surface_count++];
  *surface = (clt_rectangle){.corner = corner, .u = u, .v = v, .albedo = {albedo, albedo, albedo}};
  assert_true(clt_rectangle_complete(surface));
}
