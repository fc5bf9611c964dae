/* Where the projector's cells fall on the surfaces, and the elements that the surfaces are divided into. */
#ifndef CLT_SIM_MESH_H
#define CLT_SIM_MESH_H

#include "sim/description.h"
#include "sim/visibility.h"

enum { CLT_ELEMENTS_MAX = 4800, CLT_ELEMENTS_WANTED = 1000 };

/* A sub-ray of a cell. */
typedef struct clt_ray_end {
  int surface;    /* that it lights from the front; -1: none */
  int element;    /* of the mesh */
  double share;   /* its solid angle over the cell's */
  double falloff; /* cos / r^2, 1/m^2: irradiance per radiant intensity */
  double s, t;    /* where on the surface */
} clt_ray_end;

typedef struct clt_mesh {
  /* The elements, small rectangles. Those that the projector lights come last, from number count - lit on. */
  int count, lit;
  clt_rectangle *elements;
  int *surface; /* of each element */
  /* cells * rays sub-rays, and the solid angle of each cell, sr */
  int cells, rays;
  clt_ray_end *ends;
  double *solid_angle;
  /* What cell i covers: the elements element[k], start[i] <= k < start[i+1], each by weight[k] of its solid angle. */
  int *start, *element;
  double *weight;
} clt_mesh;

/* Traces the cells and divides the surfaces into elements about as large as the median footprint of a cell, smaller
 * where that gives fewer than CLT_ELEMENTS_WANTED, larger where it gives more than CLT_ELEMENTS_MAX. visibility is of
 * the description's surfaces. mesh was zeroed by the caller and is finished by it in either case. */
clt_status clt_mesh_init(clt_mesh *mesh, const clt_scene_description *description, const clt_visibility *visibility,
                         clt_error *error);
void clt_mesh_finish(clt_mesh *mesh);

#endif
