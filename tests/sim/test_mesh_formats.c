#include "room.h"
#include "sim/mesh_file.h"

static const double grey[CLT_SIM_CHANNELS_MAX] = {0.5, 0.5, 0.5};
static const clt_mesh_place here = {.scale = 1.0};

/* A room of three walls and a floor that looks the other way round corners: quadrilaterals over shared points. */
enum { POINTS = 8, SIDES = 4 };
static const clt_vector points[POINTS] = {{-1, -1, 0}, {1, -1, 0}, {1.5, 1, 0},    {-1.5, 1, 0},
                                          {-1, -1, 2}, {1, -1, 2}, {1.5, 1, 2.25}, {-1.5, 1, 2.25}};
static const int sides[SIDES][4] = {{0, 1, 2, 3}, {0, 3, 7, 4}, {3, 2, 6, 7}, {1, 5, 6, 2}};

/* A file in the making. */
typedef struct bytes {
  unsigned char data[8192];
  size_t size;
} bytes;

static void put(bytes *to, const void *data, size_t size) {
  assert_true(to->size + size <= sizeof to->data);
  memcpy(&to->data[to->size], data, size);
  to->size += size;
}

static void put_text(bytes *to, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  int length = vsnprintf((char *)&to->data[to->size], sizeof to->data - to->size, format, arguments);
  va_end(arguments);
  assert_true(length >= 0 && to->size + (size_t)length < sizeof to->data);
  to->size += (size_t)length;
}

/* The lowest `size` bytes of a value, the least or the most significant first. */
static void put_number(bytes *to, uint32_t value, int size, bool least_first) {
  for (int k = 0; k < size; k++) {
    unsigned char byte = (unsigned char)(value >> 8 * (least_first ? k : size - 1 - k));
    put(to, &byte, 1);
  }
}

static void put_float(bytes *to, double value, bool least_first) {
  float single = (float)value;
  uint32_t bits;
  memcpy(&bits, &single, sizeof bits);
  put_number(to, bits, 4, least_first);
}

static void put_base64(bytes *to, const bytes *from) {
  const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t k = 0; k < from->size; k += 3) {
    unsigned value = 0;
    for (size_t b = k; b < k + 3; b++) {
      value = value << 8 | (b < from->size ? from->data[b] : 0u);
    }
    for (size_t d = 0; d < 4; d++) {
      bool beyond = k + d > from->size;
      put_text(to, "%c", beyond ? '=' : digits[value >> 6 * (3 - d) & 63]);
    }
  }
}

/* What the tests vary: point 1, a corner of the last side, the number of points that the header promises, and how a
 * node of a glTF file places the room. */
typedef struct variant {
  clt_vector point;
  int corner, promised;
  const char *node;
} variant;
static const variant sound = {{1, -1, 0}, 2, POINTS, ""};

static clt_vector point_of(const variant *with, int k) {
  return k == 1 ? with->point : points[k];
}

static int corner_of(const variant *with, int side, int k) {
  return side == SIDES - 1 && k == 3 ? with->corner : sides[side][k];
}

static void write_obj(bytes *to, const variant *with) {
  for (int k = 0; k < POINTS; k++) {
    clt_vector at = point_of(with, k);
    put_text(to, "v %g %g %g\n", at.x, at.y, at.z);
  }
  for (int k = 0; k < SIDES; k++) {
    put_text(to, "f %d %d %d %d\n", sides[k][0] + 1, sides[k][1] + 1, sides[k][2] + 1, corner_of(with, k, 3) + 1);
  }
}

static void ply_header(bytes *to, const variant *with, const char *format) {
  put_text(to, "ply\nformat %s 1.0\ncomment a room\nelement vertex %d\nproperty float x\nproperty float y\n", format,
           with->promised);
  put_text(to, "property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n", SIDES);
}

static void write_ply(bytes *to, const variant *with) {
  ply_header(to, with, "ascii");
  for (int k = 0; k < POINTS; k++) {
    clt_vector at = point_of(with, k);
    put_text(to, "%g %g %g\n", at.x, at.y, at.z);
  }
  for (int k = 0; k < SIDES; k++) {
    put_text(to, "4 %d %d %d %d\n", sides[k][0], sides[k][1], sides[k][2], corner_of(with, k, 3));
  }
}

static void write_binary_ply(bytes *to, const variant *with, bool least_first) {
  ply_header(to, with, least_first ? "binary_little_endian" : "binary_big_endian");
  for (int k = 0; k < POINTS; k++) {
    clt_vector at = point_of(with, k);
    put_float(to, at.x, least_first);
    put_float(to, at.y, least_first);
    put_float(to, at.z, least_first);
  }
  for (int k = 0; k < SIDES; k++) {
    put_number(to, 4, 1, true);
    for (int c = 0; c < 4; c++) {
      put_number(to, (uint32_t)corner_of(with, k, c), 4, least_first);
    }
  }
}

static void write_little_ply(bytes *to, const variant *with) {
  write_binary_ply(to, with, true);
}

static void write_big_ply(bytes *to, const variant *with) {
  write_binary_ply(to, with, false);
}

/* Points, of which y is up in glTF, then the corners of two triangles for each side. */
static void gltf_buffer(bytes *to, const variant *with) {
  const int order[6] = {0, 1, 2, 0, 2, 3};
  for (int k = 0; k < POINTS; k++) {
    clt_vector at = point_of(with, k);
    put_float(to, at.x, true);
    put_float(to, at.z, true);
    put_float(to, -at.y, true);
  }
  for (int k = 0; k < 6 * SIDES; k++) {
    put_number(to, (uint32_t)corner_of(with, k / 6, order[k % 6]), 2, true);
  }
}

/* uri: of the buffer, or NULL in a .glb, whose second chunk it is. */
static void gltf_text(bytes *to, const variant *with, const bytes *buffer, bool embedded) {
  int node = strlen(with->node) > 0;
  put_text(to, "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[");
  put_text(to, node ? "{%s,\"children\":[1]},{\"mesh\":0}]," : "%s{\"mesh\":0}],", with->node);
  put_text(to,
           "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],\"bufferViews\":["
           "{\"buffer\":0,\"byteOffset\":0,\"byteLength\":%d},{\"buffer\":0,\"byteOffset\":%d,\"byteLength\":%d}],",
           12 * POINTS, 12 * POINTS, 12 * SIDES);
  put_text(to,
           "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":%d,\"type\":\"VEC3\"},"
           "{\"bufferView\":1,\"componentType\":5123,\"count\":%d,\"type\":\"SCALAR\"}],",
           with->promised, 6 * SIDES);
  put_text(to, "\"buffers\":[{\"byteLength\":%zu", buffer->size);
  if (embedded) {
    put_text(to, ",\"uri\":\"data:application/octet-stream;base64,");
    put_base64(to, buffer);
    put_text(to, "\"");
  }
  put_text(to, "}]}");
}

static void write_gltf(bytes *to, const variant *with) {
  bytes buffer = {.size = 0};
  gltf_buffer(&buffer, with);
  gltf_text(to, with, &buffer, true);
}

static void write_glb(bytes *to, const variant *with) {
  bytes buffer = {.size = 0}, text = {.size = 0};
  gltf_buffer(&buffer, with);
  gltf_text(&text, with, &buffer, false);
  while (text.size % 4 != 0) {
    put_text(&text, " ");
  }
  put(to, "glTF", 4);
  put_number(to, 2, 4, true);
  put_number(to, (uint32_t)(28 + text.size + buffer.size), 4, true);
  put_number(to, (uint32_t)text.size, 4, true);
  put(to, "JSON", 4);
  put(to, text.data, text.size);
  put_number(to, (uint32_t)buffer.size, 4, true);
  put(to, "BIN\0", 4);
  put(to, buffer.data, buffer.size);
}

static const struct format {
  const char *name; /* of a file */
  void (*write)(bytes *to, const variant *with);
  bool ends; /* so that what is cut off is missed */
} formats[] = {{"room.obj", write_obj, false},    {"room.ply", write_ply, true},   {"room.ply", write_little_ply, true},
               {"room.PLY", write_big_ply, true}, {"room.gltf", write_gltf, true}, {"room.glb", write_glb, true}};
enum { FORMATS = sizeof formats / sizeof formats[0] };

static clt_status read_bytes(clt_scene_description *scene, const char *name, const bytes *content,
                             const clt_mesh_place *place, clt_error *error) {
  char folder[64], path[96];
  test_folder(folder);
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_true(fwrite(content->data, 1, content->size, file) == content->size);
  fclose(file);
  clt_mesh_place as_format = *place;
  as_format.y_up = clt_mesh_file_is_y_up(path);
  clt_status status = clt_mesh_file_add(scene, path, &as_format, CLT_FACING_OUT, grey, error);
  unlink(path);
  rmdir(folder);
  if (status == CLT_FAILED && strstr(error->message, "build reads no meshes") != NULL) {
    clt_scene_description_finish(scene);
    free(scene);
    skip();
  }
  return status;
}

static clt_scene_description *read_room(const struct format *as, const variant *with, const clt_mesh_place *place) {
  clt_scene_description *scene = calloc(1, sizeof *scene);
  assert_non_null(scene);
  bytes content = {.size = 0};
  clt_error error = {.status = CLT_OK};
  as->write(&content, with);
  assert_ok(read_bytes(scene, as->name, &content, place, &error), error);
  return scene;
}

static void assert_at(clt_vector actual, clt_vector wanted, double tolerance) {
  assert_near(actual.x, wanted.x, tolerance);
  assert_near(actual.y, wanted.y, tolerance);
  assert_near(actual.z, wanted.z, tolerance);
}

/* The two triangles are those of the side, cut along one of its diagonals. */
static void assert_side(const clt_rectangle *triangles, const int *side, const clt_mesh_place *place) {
  clt_vector at[4];
  for (int k = 0; k < 4; k++) {
    at[k] = vec_along(place->at, place->scale, points[side[k]], 0.0, points[0]);
  }
  clt_vector twice = vec_cross(vec_sub(at[2], at[0]), vec_sub(at[3], at[1])); /* normal times twice the area */
  for (int n = 0; n < 2; n++) {
    assert_at(triangles[n].normal, vec_unit(twice), 1e-12);
    for (int c = 0; c < 3; c++) {
      double nearest = INFINITY;
      for (int k = 0; k < 4; k++) {
        nearest = fmin(nearest, vec_length(vec_sub(clt_rectangle_vertex(&triangles[n], c), at[k])));
      }
      assert_near(nearest, 0.0, 1e-12);
    }
  }
  assert_near(clt_rectangle_area(&triangles[0]) + clt_rectangle_area(&triangles[1]), 0.5 * vec_length(twice), 1e-12);
}

static void every_format_reads_alike(void **state) {
  (void)state;
  const clt_mesh_place place = {{1, -2, 0.5}, 2.0, false};
  for (int f = 0; f < FORMATS; f++) {
    clt_scene_description *scene = read_room(&formats[f], &sound, &place);
    assert_int_equal(scene->surface_count, 2 * SIDES);
    for (int k = 0; k < SIDES; k++) {
      assert_side(&scene->surfaces[2 * k], sides[k], &place);
    }
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* Nodes of glTF place what is below them: scaled, then turned a quarter about y (up), then moved. */
static void nodes_place_their_parts(void **state) {
  (void)state;
  variant turned = sound;
  turned.node = "\"translation\":[10,20,30],\"rotation\":[0,0.7071067811865476,0,0.7071067811865476],\"scale\":[1,2,4]";
  for (int f = FORMATS - 2; f < FORMATS; f++) {
    clt_scene_description *plain = read_room(&formats[f], &sound, &here);
    clt_scene_description *scene = read_room(&formats[f], &turned, &here);
    assert_int_equal(scene->surface_count, plain->surface_count);
    for (int k = 0; k < scene->surface_count; k++) {
      for (int c = 0; c < 3; c++) {
        clt_vector from = clt_rectangle_vertex(&plain->surfaces[k], c);
        clt_vector scaled = {from.x, 2 * from.z, -4 * from.y};            /* in the file's axes */
        clt_vector moved = {scaled.z + 10, scaled.y + 20, 30 - scaled.x}; /* +z turns to +x about y */
        assert_at(clt_rectangle_vertex(&scene->surfaces[k], c), (clt_vector){moved.x, -moved.z, moved.y}, 1e-5);
      }
    }
    clt_scene_description_finish(plain);
    free(plain);
    clt_scene_description_finish(scene);
    free(scene);
  }
}

/* A node that mirrors keeps outsides outside: normals are mirrored too. */
static void mirrored_parts_keep_their_outside(void **state) {
  (void)state;
  variant mirrored = sound;
  mirrored.node = "\"scale\":[-1,1,1]";
  clt_scene_description *plain = read_room(&formats[FORMATS - 1], &sound, &here);
  clt_scene_description *scene = read_room(&formats[FORMATS - 1], &mirrored, &here);
  for (int k = 0; k < scene->surface_count; k++) {
    clt_vector normal = plain->surfaces[k].normal, centre = clt_rectangle_centre(&plain->surfaces[k]);
    assert_at(scene->surfaces[k].normal, (clt_vector){-normal.x, normal.y, normal.z}, 1e-12);
    assert_at(clt_rectangle_centre(&scene->surfaces[k]), (clt_vector){-centre.x, centre.y, centre.z}, 1e-12);
  }
  clt_scene_description_finish(plain);
  free(plain);
  clt_scene_description_finish(scene);
  free(scene);
}

/* The message names the file and what is wrong; nothing is added. */
static void assert_refused(const char *name, const bytes *content, const char *why) {
  clt_scene_description *scene = calloc(1, sizeof *scene);
  clt_error error = {.status = CLT_OK};
  clt_status status = read_bytes(scene, name, content, &here, &error);
  if (status != CLT_BAD_INPUT || strstr(error.message, name) == NULL || strstr(error.message, why) == NULL ||
      scene->surface_count != 0) {
    fail_msg("%s with '%s' gave %s, %d surfaces: %s", name, why, clt_status_name(status), scene->surface_count,
             error.message);
  }
  clt_scene_description_finish(scene);
  free(scene);
}

static void mistakes_are_refused(void **state) {
  (void)state;
  for (int f = 0; f < FORMATS; f++) {
    const struct {
      variant with;
      const char *why;
    } mistakes[] = {{{{NAN, -1, 0}, 2, POINTS, ""}, "not a number"},
                    {{{-1, -1, 0}, 2, POINTS, ""}, "has no area"},
                    {{{1, -1, 0}, 2, 400000000, ""}, ""},
                    {{{1, -1, 0}, 60000, POINTS, ""}, ""}};
    /* a .gltf or .glb may leave such corners out, an .obj has no header */
    for (int k = 0; k < (f >= FORMATS - 2 ? 3 : 4); k++) {
      bytes content = {.size = 0};
      if (f != 0 || k != 2) {
        formats[f].write(&content, &mistakes[k].with);
        assert_refused(formats[f].name, &content, mistakes[k].why);
      }
    }
    bytes empty = {.size = 0}, nonsense = {.size = 0};
    put_text(&nonsense, "this is no mesh at all\n");
    assert_refused(formats[f].name, &empty, "");
    assert_refused(formats[f].name, &nonsense, "");
  }
  bytes content = {.size = 0};
  write_obj(&content, &sound);
  assert_refused("room.blend", &content, ".obj, .ply, .gltf and .glb");
  clt_scene_description *scene = calloc(1, sizeof *scene);
  clt_error error = {.status = CLT_OK};
  assert_int_equal(clt_mesh_file_add(scene, "/nowhere/room.ply", &here, CLT_FACING_OUT, grey, &error), CLT_BAD_INPUT);
  assert_non_null(strstr(error.message, "/nowhere/room.ply"));
  assert_int_equal(clt_mesh_file_add(scene, "/.ply", &here, CLT_FACING_OUT, grey, &error), CLT_BAD_INPUT);
  clt_scene_description_finish(scene);
  free(scene);
}

/* Files that are cut off anywhere are refused, or, where the format cannot tell, read as far as they go. */
static void cut_files(void **state) {
  (void)state;
  for (int f = 0; f < FORMATS; f++) {
    bytes whole = {.size = 0};
    formats[f].write(&whole, &sound);
    for (size_t size = 0; size < whole.size - 1; size += 1 + whole.size / 200) {
      bytes cut = whole;
      cut.size = size;
      if (formats[f].ends) {
        assert_refused(formats[f].name, &cut, "");
      } else {
        clt_scene_description *scene = calloc(1, sizeof *scene);
        clt_error error = {.status = CLT_OK};
        clt_status status = read_bytes(scene, formats[f].name, &cut, &here, &error);
        assert_true(status == CLT_OK ? scene->surface_count > 0 : status == CLT_BAD_INPUT);
        assert_true(scene->surface_count < 2 * SIDES);
        clt_scene_description_finish(scene);
        free(scene);
      }
    }
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_format_reads_alike),
      cmocka_unit_test(nodes_place_their_parts),
      cmocka_unit_test(mirrored_parts_keep_their_outside),
      cmocka_unit_test(mistakes_are_refused),
      cmocka_unit_test(cut_files),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
