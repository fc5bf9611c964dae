/* The room between a window and a camera: what is on the screen lights a scene (docs/scene-file.md), and what the
 * scene's camera sees of it is published for the simulated USB camera (light.h).
 *
 *   screen.c  what is on an X screen
 *   room.c    light on the grid and in the camera's pixels
 *   main.c    sixty times a second; commands */
#ifndef VM_ROOM_H
#define VM_ROOM_H

/* XShm.h needs Xlib.h before it. */
/* clang-format off */
#include <X11/Xlib.h>
#include <X11/extensions/XShm.h>
/* clang-format on */

#include "../light.h"
#include "counterlight/counterlight.h"

/* --- screen.c --- */
typedef struct screen {
  Display *display;
  XImage *image;
  XShmSegmentInfo segment;
  uint8_t *last; /* the picture before, blue, green, red, 0 for each pixel */
  int width, height;
} screen;
bool screen_open(screen *seen);
void screen_close(screen *seen);
/* Takes the picture that is on the screen; true where it differs from the last. */
bool screen_look(screen *seen);

/* --- room.c --- */
enum { CAMERA_POINTS = 4 };
/* What a camera pixel sees: a cell of the grid, and points of the screen. */
typedef struct camera_pixel {
  bool lit;
  uint32_t cell, point[CAMERA_POINTS];
} camera_pixel;

typedef struct room {
  clt_scene *scene;
  const clt_transport *transport;
  clt_transport_info grid;
  clt_panel panel;
  uint32_t width, height; /* of the camera's picture */
  camera_pixel *pixels;
  clt_image light;  /* of each pixel of the screen, linear, three channels */
  double *drive;    /* channels x cells: its mean over each */
  double *radiance; /* channels x cells, exact */
  double *own;      /* channels x cells: F, what a cell's own light adds to it */
} room;
clt_status room_open(const char *scene, int screen_width, int screen_height, room *out, clt_error *error);
void room_close(room *of);
/* Computes the light of what is on the screen. */
clt_status room_light(room *of, const uint8_t *bgrx, clt_error *error);
/* What each pixel of the camera sees of it: the cell's light, with its own light at the resolution of the screen. */
void room_view(const room *of, float *picture);
/* Writes `radiance` as an image of the grid. */
clt_status room_save(const room *of, const char *path, clt_error *error);

#endif
