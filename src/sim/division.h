/* How surfaces are divided into elements. */
#ifndef CLT_SIM_DIVISION_H
#define CLT_SIM_DIVISION_H

#include "sim/sights.h"

/* How a surface is divided: columns x rows elements from number first on, none where it takes no part in the exchange
 * of light. A triangle has as many columns as rows: row r holds columns - r upright triangles with turned ones between
 * them. */
typedef struct clt_division {
  int columns, rows, first;
  bool triangle;
} clt_division;

/* How many elements there should be: at least `wanted`, at most `most`. */
typedef struct clt_mesh_size {
  int wanted, most;
} clt_mesh_size;

/* Divides the surfaces that exchange light into elements of about `footprint`, m^2, smaller where that gives fewer than
 * size.wanted, larger where it gives more than size.most. divisions: one for each surface. Returns how many elements
 * there are. */
int clt_divide(const clt_scene_description *description, const clt_sights *sights, double footprint, clt_mesh_size size,
               clt_division *divisions);

/* The element at a place on a divided surface. */
int clt_division_element(const clt_division *of, double s, double t);
/* Element number `number` of a surface, counted from its first. */
clt_rectangle clt_division_part(const clt_rectangle *whole, const clt_division *by, int number);

#endif
