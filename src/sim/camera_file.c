/* The keys of a camera with pixels of its own. */
#include "sim/scene_file.h"

enum { SIDE_MAX = 4096, PIXELS_MAX = 1 << 22, RAYS_USUAL = 4 };

static void read_size(clt_section section, clt_camera_description *camera) {
  double pixels[2] = {1.0, 1.0};
  clt_read_numbers(section, "pixels", pixels, 2, 2, 1.0, SIDE_MAX);
  if (pixels[0] != floor(pixels[0]) || pixels[1] != floor(pixels[1])) {
    clt_section_fail(section, "pixels", "are %g x %g; legal is a whole number each way", pixels[0], pixels[1]);
  } else if (pixels[0] * pixels[1] > PIXELS_MAX) {
    clt_section_fail(section, "pixels", "%g x %g are %g; legal are at most %d", pixels[0], pixels[1],
                     pixels[0] * pixels[1], PIXELS_MAX);
  }
  camera->width = (int)pixels[0];
  camera->height = (int)pixels[1];
}

/* Refuses a lens that folds its image somewhere. */
static void check_distortion(clt_section section, const clt_camera_description *camera) {
  enum { STEPS = 32 };
  for (int k = 0; k < (STEPS + 1) * (STEPS + 1); k++) {
    double x = 2.0 * (k % (STEPS + 1)) / STEPS - 1.0, y = 2.0 * (k / (STEPS + 1)) / STEPS - 1.0;
    clt_vector direction;
    if (!clt_optics_direction(&camera->pinhole, camera->distortion, x, y, &direction)) {
      clt_section_fail(section, "distortion",
                       "no direction is seen %.3g half-widths right and %.3g half-heights up of "
                       "the image's middle: the lens folds its image; take smaller numbers or a smaller tangent",
                       x, y);
      return;
    }
  }
}

static void read_lens(clt_section section, clt_scene_description *description) {
  clt_camera_description *camera = &description->camera;
  if (!camera->placed) {
    camera->pinhole = description->projector.pinhole;
    bool other = clt_read_numbers(section, "tangent", camera->pinhole.tangent, 2, 2, 1e-3, 10.0) == 2;
    camera->placed = other || clt_section_has(section, "distortion");
  }
  clt_read_numbers(section, "distortion", camera->distortion, CLT_DISTORTION, CLT_DISTORTION, -100.0, 100.0);
  check_distortion(section, camera);
}

void clt_scene_read_pixels(clt_section section, clt_scene_description *description) {
  clt_camera_description *camera = &description->camera;
  camera->own_pixels = clt_section_has(section, "pixels");
  if (camera->own_pixels && description->transport != NULL) {
    clt_section_fail(section, "pixels", "means nothing beside transport_file; leave it out");
  } else if (camera->own_pixels && clt_section_has(section, "cell_pixels")) {
    clt_section_fail(section, "cell_pixels", "means nothing beside pixels; leave it out");
  } else if (camera->own_pixels) {
    read_size(section, camera);
    camera->cell_pixels = 1;
    camera->rays = clt_read_integer(section, "rays", RAYS_USUAL, 1, 16);
    read_lens(section, description);
  } else if (clt_section_has(section, "rays") || clt_section_has(section, "distortion")) {
    clt_section_fail(section, clt_section_has(section, "rays") ? "rays" : "distortion",
                     "means nothing without pixels = [width, height]");
  } else {
    camera->cell_pixels = clt_read_integer(section, "cell_pixels", 2, 1, 16);
    camera->width = description->width * camera->cell_pixels;
    camera->height = description->height * camera->cell_pixels;
  }
}
