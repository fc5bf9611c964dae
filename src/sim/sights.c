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

/* What is known of a surface, or of the group of a root. */
enum { LIT = 1, SEEN = 2, MIRRORED = 4, JOINED = 8 };

static bool throws_light(const clt_scene_description *description, int glossy, int from) {
  const double *strength = description->gloss[description->surfaces[glossy].material].strength;
  for (int c = 0; c < description->channels; c++) {
    if (strength[c] > 0.0 && description->surfaces[from].albedo[c] > 0.0) {
      return true;
    }
  }
  return false;
}

/* Marks the surfaces whose light the gloss of a seen one throws to the camera. Returns how many seen ones have gloss.
 */
static int mark_mirrored(search *s, const bool *seen, unsigned char *known) {
  const clt_rectangle *surfaces = s->description->surfaces;
  int glossy = 0;
  for (int a = 0; a < s->description->surface_count; a++) {
    if (!seen[a] || !clt_scene_is_glossy(s->description, a)) {
      continue;
    }
    glossy++;
    for (int b = 0; b < s->description->surface_count; b++) {
      if (b != a && throws_light(s->description, a, b) && clt_rectangles_face(&surfaces[a], &surfaces[b]) &&
          in_sight(s, a, b)) {
        known[b] |= MIRRORED;
      }
    }
  }
  return glossy;
}

/* Keeps the groups that are lit and seen, in themselves or in gloss. A surface alone has no light but direct light,
 * which only gloss brings to other cells. groups: of each root what is known of its members, zeros. */
static void keep_reached(search *s, const unsigned char *known, unsigned char *groups, clt_sights *sights) {
  for (int k = 0; k < s->description->surface_count; k++) {
    int root = root_of(s, k);
    groups[root] |= (unsigned char)(known[k] | (root != k ? JOINED : 0));
  }
  for (int k = 0; k < s->description->surface_count; k++) {
    int group = groups[root_of(s, k)];
    bool seen = (group & MIRRORED) != 0 || (group & (SEEN | JOINED)) == (SEEN | JOINED);
    sights->exchange[k] = (group & LIT) != 0 && seen;
    sights->exchanging += sights->exchange[k];
  }
}

clt_status clt_sights_init(clt_sights *sights, const clt_scene_description *description,
                           const clt_visibility *visibility, const clt_cells *cells, clt_error *error) {
  size_t count = (size_t)description->surface_count;
  search s = {description, visibility, clt_alloc(count, sizeof *s.parent), 0};
  unsigned char *known = clt_alloc(2 * count, 1);
  sights->exchange = clt_alloc(count, sizeof *sights->exchange);
  if (!s.parent || !known || !sights->exchange) {
    free(s.parent);
    free(known);
    return clt_fail(error, CLT_FAILED, "%s: out of memory for %zu surfaces", description->path, count);
  }
  for (int k = 0; k < description->surface_count; k++) {
    s.parent[k] = k;
    known[k] = (unsigned char)((cells->lit[k] ? LIT : 0) | (cells->seen[k] ? SEEN : 0));
  }
  sights->facing = join(&s);
  sights->glossy = mark_mirrored(&s, cells->seen, known);
  keep_reached(&s, known, known + count, sights);
  free(s.parent);
  free(known);
  return CLT_OK;
}

void clt_sights_finish(clt_sights *sights) {
  free(sights->exchange);
  *sights = (clt_sights){0};
}
