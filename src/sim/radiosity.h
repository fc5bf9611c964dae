/* The light of a scene of many cells: the exchange between elements held as a hierarchical matrix, and solved for every
 * product with T.
 *
 * With the terms of sim/mesh.h and s = (I - K)^-1 z the symmetrised radiosity of z = D W' Phi x,
 *   T x = F x + (V D (s - z) + M D s) / pi,
 * s - z by conjugate gradients on I - K, every channel in a lane of its own. T is stored nowhere: it is a storage kind
 * of clt_transport ("radiosity") whose products are these, of cost linear in the cells. */
#ifndef CLT_SIM_RADIOSITY_H
#define CLT_SIM_RADIOSITY_H

#include "sim/layout.h"
#include "sim/sparse.h"

/* The transport of a layout, for drive above the panel's black: T (1 - black). Takes the layout over (it is emptied) in
 * either case. Products of several threads wait for each other. Its diagonal is F, which leaves out the light that
 * returns to the cell that sent it. It cannot be saved. */
clt_status clt_radiosity_transport(clt_layout *layout, clt_transport **out, clt_error *error);
/* How fine the mesh of a layout for it is. */
clt_mesh_size clt_radiosity_mesh_size(const clt_scene_description *description);

/* What `count` cells show under a drive (channels * cells values): T drive as the product has it (simulated), and with
 * the light that reaches the elements they see gathered from every element of the scene, each by its form factor and
 * its sampled visibility in double (exact). Values: cell k of channel c at [c * count + k]. transport is one of
 * clt_radiosity_transport, without gloss and not used by another thread meanwhile. */
clt_status clt_radiosity_gather(const clt_transport *transport, const double *drive, const int *cells, int count,
                                double *simulated, double *exact, clt_error *error);
/* True for a transport of this kind. */
bool clt_radiosity_is(const clt_transport *transport);

#endif
