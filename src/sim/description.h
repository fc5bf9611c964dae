/* What a scene file says, checked and complete. */
#ifndef CLT_SIM_DESCRIPTION_H
#define CLT_SIM_DESCRIPTION_H

#include <stdint.h>

#include "counterlight/image.h"
#include "counterlight/transport.h"
#include "sim/geometry.h"
#include "sim/optics.h"

enum {
  CLT_SURFACES_MAX = 2000,
  CLT_RECTANGLE_CELLS_MAX = 1024 * 576,
  CLT_FINE_GRID = 6400, /* up to so many cells light is computed as a whole matrix; more are lit by few rays each */
  CLT_EXPOSURE_DELAY_MAX = 8,
  CLT_SIM_CHANNELS_MAX = 3,
  CLT_MATERIALS_MAX = 64
};

typedef struct clt_projector_description {
  clt_pinhole pinhole;
  double intensity[CLT_SIM_CHANNELS_MAX]; /* radiant intensity of a fully driven pixel, W/sr */
  clt_curve response;                     /* code value to drive */
  int bits;
  double black; /* fraction of full drive that leaks at drive 0: light = black + (1 - black) drive */
  double refresh_s, latency_s;
  double jitter_s; /* by which the latency varies to either side, by chance */
} clt_projector_description;

typedef struct clt_camera_description {
  bool placed;         /* it has a view of its own; else it stands at the projector and sees all that is lit */
  clt_pinhole pinhole; /* of a placed camera, and of one with pixels of its own */
  int width, height;   /* of its image, pixels */
  int cell_pixels;     /* a cell is cell_pixels x cell_pixels camera pixels; 1 where they are its own */
  bool own_pixels;     /* its pixels know no grid: sim/view.h says what they see */
  int rays;            /* of such a camera: traced per pixel, rays x rays */
  double distortion[CLT_DISTORTION]; /* of its lens, zeros where it has none: sim/optics.h */
  int bits;
  clt_curve response;
  double responsivity;          /* fraction of full well per radiance and second; 0: chosen to suit the scene */
  double full_well, read_noise; /* electrons */
  bool photon_noise;            /* electrons are counted, so that their number varies */
  int black_level;              /* code value without light */
  double frame_s;
  int exposure_delay; /* frames from a request until it holds */
} clt_camera_description;

typedef struct clt_flicker_description {
  double mains_hz, depth; /* of the ambient light: its mean is `ambient`, it varies by +- depth of that */
} clt_flicker_description;

typedef struct clt_drift_description {
  double per_hour, amplitude; /* relative to the brightness at the start */
  double period_s;            /* of the swing by amplitude */
} clt_drift_description;

typedef struct clt_faults_description {
  double dropped, stuck, late, torn; /* probabilities, of a frame */
  double late_s;
  double gone_at_s, gone_s, gone_every_s; /* the camera is unplugged for gone_s (0: never), again every gone_every_s */
} clt_faults_description;

typedef struct clt_subsurface_description {
  double share, radius; /* of the light; sigma, cells */
} clt_subsurface_description;

typedef struct clt_vibration_description {
  double amplitude[2], hz; /* cells to the right and down */
} clt_vibration_description;

typedef struct clt_change_description {
  double at_s, for_s, every_s;  /* of the scene's clock; for_s 0: it stays; every_s 0: once */
  double speed[2];              /* cells a second to the right and down */
  int left, top, width, height; /* cells */
  double factor[CLT_SIM_CHANNELS_MAX];
} clt_change_description;

/* Light that a surface throws towards the mirror direction, on top of the diffuse light: of irradiance from one
 * direction, strength (exponent + 2) / (2 pi) cos^exponent(angle from the mirror direction) per steradian (Phong 1975,
 * made to conserve energy: Lafortune and Willems 1994). At most the fraction `strength` of the light comes back so. */
typedef struct clt_gloss {
  double strength[CLT_SIM_CHANNELS_MAX]; /* 0: no gloss */
  double exponent;
} clt_gloss;

/* Strengths of the effects that have keys of their own; zero strength is an effect left out. */
typedef struct clt_effects_description {
  /* light of channel c = sum over k of crosstalk[c][k] drive of channel k */
  double crosstalk[CLT_SIM_CHANNELS_MAX][CLT_SIM_CHANNELS_MAX];
  double defocus;   /* of the projector: sigma, cells */
  double lens_blur; /* of the camera: sigma, pixels */
  double line_s;    /* from a row of pixels to the next: rolling shutter */
  clt_flicker_description flicker;
  clt_drift_description drift;
  clt_faults_description faults;
  clt_subsurface_description subsurface;
  clt_vibration_description vibration;
  clt_change_description change;
  double vignetting; /* share of the light that the image's corner loses, 0..0.95 */
} clt_effects_description;

typedef struct clt_scene_description {
  char path[CLT_PATH_MAX];
  int width, height, channels;
  int rays; /* rays traced per cell: rays x rays */
  clt_projector_description projector;
  clt_camera_description camera;
  double ambient[CLT_SIM_CHANNELS_MAX]; /* radiance added to every cell */
  uint64_t seed;
  clt_effects_description effects;
  clt_gloss gloss[CLT_MATERIALS_MAX]; /* of each material */
  clt_rectangle *surfaces;            /* owned here, with room for surface_room of them */
  int surface_count, surface_room;
  clt_transport *transport; /* of a transport_file, owned here; NULL where there are surfaces */
} clt_scene_description;

/* Reads a scene file. CLT_BAD_INPUT with file, line, key and the legal range. The description was zeroed by the caller,
 * and is finished by it in either case. */
clt_status clt_scene_read(const char *path, clt_scene_description *description, clt_error *error);
void clt_scene_description_finish(clt_scene_description *description);

/* Makes room for `more` surfaces behind those that are there; false where a scene would have more than
 * CLT_SURFACES_MAX, or memory is short. */
bool clt_scene_reserve_surfaces(clt_scene_description *description, int more);

/* Where the camera is. */
clt_vector clt_scene_eye(const clt_scene_description *description);
/* True where a surface's material has gloss in some channel. */
bool clt_scene_is_glossy(const clt_scene_description *description, int surface);

/* Ambient radiance of the brightest channel. */
double clt_ambient_most(const clt_scene_description *description);

/* Centre of sub-ray `ray` (0..rays*rays-1) of a cell (row-major, row 0 at the top): its direction from the projector,
 * and the solid angle it stands for, sr. */
clt_vector clt_scene_ray(const clt_scene_description *description, int cell, int ray, double *solid_angle);

#endif
