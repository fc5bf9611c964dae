#include "sim/sights.h"

#include <stdlib.h>

#include "base/memory.h"

/* Segments that are tried between two surfaces before they count as hidden from each other, and in all: then the rest
 * count as in sight. */
enum { SEGMENTS = 256, TRIES_MAX = 1 << 20 };

typedef struct search {
  const clt_scene_description *description;
  const clt_visibility *visibility;
  int *parent; /* of each surface, towards the root of the group that it is in */
  int tries;
} search;

static int root_of(search *s, int surface) {
  while (s->parent[surface] != surface) {
    s->parent[surface] = s->parent[s->parent[surface]];
    surface = s->parent[surface];
  }
  return surface;
}

static bool both_reflect(const clt_scene_description *description, int a, int b) {
  for (int c = 0; c < description->channels; c++) {
    if (description->surfaces[a].albedo[c] > 0.0 && description->surfaces[b].albedo[c] > 0.0) {
      return true;
    }
  }
  return false;
}

static bool in_front(const clt_rectangle *of, clt_vector point) {
  return vec_dot(of->normal, vec_sub(point, of->corner)) > 0.0;
}

/* Whether one of a number of segments between points spread over both (Roberts' R4 sequence) is open. */
static bool in_sight(search *s, int a, int b) {
  const double step[4] = {0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101};
  const clt_rectangle *one = &s->description->surfaces[a], *other = &s->description->surfaces[b];
  for (int k = 1; k <= SEGMENTS; k++, s->tries++) {
    double at[4];
    for (int d = 0; d < 4; d++) {
      at[d] = fmod(0.5 + k * step[d], 1.0);
    }
    clt_vector from = clt_rectangle_point(one, at[0], at[1]), to = clt_rectangle_point(other, at[2], at[3]);
    if (s->tries >= TRIES_MAX ||
        (in_front(one, to) && in_front(other, from) && !clt_visibility_blocked(s->visibility, from, to, a, b))) {
      return true;
    }
  }
  return false;
}

/* Joins the surfaces that exchange light into groups; returns the pairs that face each other. Pairs of one group need
 * no further look. */
static int join(search *s) {
  const clt_rectangle *surfaces = s->description->surfaces;
  int facing = 0;
  for (int a = 0; a < s->description->surface_count; a++) {
    for (int b = 0; b < a; b++) {
      if (!clt_rectangles_face(&surfaces[a], &surfaces[b])) {
        continue;
      }
      facing++;
      int one = root_of(s, a), other = root_of(s, b);
      if (one != other && both_reflect(s->description, a, b) && in_sight(s, a, b)) {
        s->parent[one] = other;
      }
    }
  }
  return facing;
}

/* Keeps the groups of two or more with a lit surface. reached: of each root, bit 0: lit; bit 1: has other members. */
static void keep_reached(search *s, const bool *lit, unsigned char *reached, clt_sights *sights) {
  for (int k = 0; k < s->description->surface_count; k++) {
    int root = root_of(s, k);
    reached[root] |= (unsigned char)((lit[k] ? 1 : 0) | (root != k ? 2 : 0));
  }
  for (int k = 0; k < s->description->surface_count; k++) {
    sights->exchange[k] = reached[root_of(s, k)] == 3;
    sights->exchanging += sights->exchange[k];
  }
}

clt_status clt_sights_init(clt_sights *sights, const clt_scene_description *description,
                           const clt_visibility *visibility, const bool *lit, clt_error *error) {
  size_t count = (size_t)description->surface_count;
  search s = {description, visibility, clt_alloc(count, sizeof *s.parent), 0};
  unsigned char *reached = clt_alloc(count, 1);
  sights->exchange = clt_alloc(count, sizeof *sights->exchange);
  if (!s.parent || !reached || !sights->exchange) {
    free(s.parent);
    free(reached);
    return clt_fail(error, CLT_FAILED, "%s: out of memory for %zu surfaces", description->path, count);
  }
  for (int k = 0; k < description->surface_count; k++) {
    s.parent[k] = k;
  }
  sights->facing = join(&s);
  keep_reached(&s, lit, reached, sights);
  free(s.parent);
  free(reached);
  return CLT_OK;
}

void clt_sights_finish(clt_sights *sights) {
  free(sights->exchange);
  *sights = (clt_sights){0};
}
