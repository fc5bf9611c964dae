/* The light of a scene of rectangles: direct light of a point projector and diffuse interreflection.
 *
 * Radiosity over the mesh's elements: B = B0 + A B, A = diag(albedo) G, G_ef the form factor from element e to f. With
 * area_e G_ef = H_ef = H_fe and D = diag(sqrt(albedo / area)), D^-1 A D = D H D =: K is symmetric, and the light that
 * has bounced at least once more is
 *   (I - A)^-1 A diag(albedo / area) = D ((I - K)^-1 - I) D,
 * so one Cholesky factor of I - K gives everything. Elements that cells have to do with are numbered last: the trailing
 * block of the factor is the factor of their Schur complement, whose inverse is their block of (I - K)^-1; the others
 * need no more. */
#ifndef CLT_SIM_LIGHT_H
#define CLT_SIM_LIGHT_H

#include "sim/layout.h"
#include "sim/occlusion.h"

enum { CLT_ELEMENTS_MAX = 4800, CLT_ELEMENTS_WANTED = 1000 };

typedef struct clt_light {
  clt_layout layout;
  /* mesh.count^2 values, column-major: H above the diagonal (row < column), the factor's work area on and below it.
   * NULL where no light goes from surface to surface, as is bounced. */
  double *exchange;
  double *bounced; /* mesh.used^2 values: D ((I - K)^-1 - I) D of the used elements, for the solved channel */
  int solved;      /* the channel whose albedo `bounced` holds; -1: none yet */
} clt_light;

/* Traces, meshes and computes H. light was zeroed by the caller and is finished by it in either case; description must
 * outlive it. */
clt_status clt_light_init(clt_light *light, const clt_scene_description *description, clt_error *error);
void clt_light_finish(clt_light *light);

/* Makes `bounced` ready for a channel; at once where its albedos are those of the solved channel. */
clt_status clt_light_solve(clt_light *light, int channel, clt_error *error);
/* Row i of the solved channel's T, W/(m^2 sr), of a panel without black leak: cells values, in double. scratch:
 * mesh.used values. solid_angle_i T_ij = solid_angle_j T_ji up to the last digits. */
void clt_light_row(const clt_light *light, int channel, int i, double *row, double *scratch);
/* Direct radiance F_i of cell i. */
double clt_light_direct(const clt_light *light, int channel, int i);

/* What was found out on the way to a scene's T. */
typedef struct clt_light_facts {
  int facing;     /* pairs of surfaces that face each other */
  int exchanging; /* surfaces that exchange light which reaches the picture; 0: T is diagonal */
  int glossy;     /* surfaces with gloss that the camera sees */
  clt_occlusion occlusion;
} clt_light_facts;

/* The whole transport of a scene of surfaces, for drive above the panel's black: T (1 - black). One entry a row where
 * no light goes from surface to surface, else dense. */
clt_status clt_light_transport(const clt_scene_description *description, clt_transport **out, clt_light_facts *facts,
                               clt_error *error);

#endif
