#include "sim/cluster.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static clt_plane plane_of(const clt_rectangle *surface) {
  clt_vector along = vec_unit(surface->u);
  return (clt_plane){surface->corner, {along, vec_cross(surface->normal, along)}, surface->normal};
}

static void place_on(const clt_plane *plane, clt_vector point, double at[2]) {
  clt_vector from = vec_sub(point, plane->origin);
  at[0] = vec_dot(from, plane->along[0]);
  at[1] = vec_dot(from, plane->along[1]);
}

/* The least box of the cluster's elements, and their area. */
static void measure(const clt_clusters *clusters, const clt_parts *parts, clt_cluster *cluster) {
  for (int axis = 0; axis < 2; axis++) {
    cluster->low[axis] = INFINITY;
    cluster->high[axis] = -INFINITY;
  }
  cluster->area = 0.0;
  for (int k = cluster->begin; k < cluster->end; k++) {
    const clt_rectangle *element = &parts->elements[clusters->order[k]];
    cluster->area += clt_rectangle_area(element);
    for (int corner = 0; corner < clt_rectangle_vertices(element); corner++) {
      double at[2];
      place_on(&clusters->plane[cluster->surface], clt_rectangle_vertex(element, corner), at);
      for (int axis = 0; axis < 2; axis++) {
        cluster->low[axis] = fmin(cluster->low[axis], at[axis]);
        cluster->high[axis] = fmax(cluster->high[axis], at[axis]);
      }
    }
  }
}

/* Moves the elements below the middle of the longer side before the others, each in their order; returns where the
 * others begin. scratch: as many values as there are elements. */
static int part(clt_clusters *clusters, const clt_parts *parts, const clt_cluster *cluster, int *scratch) {
  int axis = cluster->high[1] - cluster->low[1] > cluster->high[0] - cluster->low[0];
  double middle = 0.5 * (cluster->low[axis] + cluster->high[axis]);
  int below = cluster->begin, above = 0;
  for (int k = cluster->begin; k < cluster->end; k++) {
    double at[2];
    int element = clusters->order[k];
    place_on(&clusters->plane[cluster->surface], clt_rectangle_centre(&parts->elements[element]), at);
    if (at[axis] < middle) {
      clusters->order[below++] = element;
    } else {
      scratch[above++] = element;
    }
  }
  memcpy(&clusters->order[below], scratch, (size_t)above * sizeof *scratch);
  return below;
}

/* The elements surface by surface, and the root of each. */
static void sort_by_surface(clt_clusters *clusters, const clt_parts *parts) {
  int next = 0;
  int *first = clusters->root; /* until the roots are known: where each surface's elements begin */
  memset(first, 0, (size_t)parts->surface_count * sizeof *first);
  for (int k = 0; k < parts->count; k++) {
    first[parts->surface[k]]++;
  }
  for (int s = 0; s < parts->surface_count; s++) {
    int held = first[s];
    first[s] = next;
    next += held;
  }
  for (int k = 0; k < parts->count; k++) {
    clusters->order[first[parts->surface[k]]++] = k;
  }
  for (int s = 0, begin = 0; s < parts->surface_count; s++) {
    int end = first[s];
    clusters->root[s] = end > begin ? clusters->count : -1;
    if (end > begin) {
      clusters->cluster[clusters->count++] = (clt_cluster){.begin = begin, .end = end, .surface = s, .child = -1};
    }
    begin = end;
  }
}

static void grow(clt_clusters *clusters, const clt_parts *parts, int *scratch) {
  for (int k = 0; k < clusters->count; k++) {
    clt_cluster *cluster = &clusters->cluster[k];
    measure(clusters, parts, cluster);
    if (cluster->end - cluster->begin <= CLT_CLUSTER_ELEMENTS) {
      continue;
    }
    int middle = part(clusters, parts, cluster, scratch);
    if (middle > cluster->begin && middle < cluster->end) {
      cluster->child = clusters->count;
      clt_cluster child = {.begin = cluster->begin, .end = middle, .surface = cluster->surface, .child = -1};
      clusters->cluster[clusters->count++] = child;
      child.begin = middle;
      child.end = cluster->end;
      clusters->cluster[clusters->count++] = child;
    }
  }
}

clt_status clt_clusters_init(clt_clusters *clusters, const clt_parts *parts, clt_error *error) {
  size_t count = (size_t)parts->count, surfaces = (size_t)parts->surface_count;
  clusters->surfaces = parts->surface_count;
  clusters->elements = parts->count;
  /* every cluster holds an element, and one that is parted leaves some on either side: fewer than 2 count */
  clusters->cluster = clt_alloc(2 * count, sizeof *clusters->cluster);
  clusters->plane = clt_alloc(surfaces, sizeof *clusters->plane);
  clusters->root = clt_alloc(surfaces, sizeof *clusters->root);
  clusters->order = clt_alloc(count, sizeof *clusters->order);
  int *scratch = clt_alloc(count, sizeof *scratch);
  if (!clusters->cluster || !clusters->plane || !clusters->root || !clusters->order || !scratch) {
    free(scratch);
    return clt_fail(error, CLT_FAILED, "out of memory for a tree over %zu surface elements", count);
  }
  for (size_t s = 0; s < surfaces; s++) {
    clusters->plane[s] = plane_of(&parts->surfaces[s]);
  }
  sort_by_surface(clusters, parts);
  grow(clusters, parts, scratch);
  free(scratch);
  return CLT_OK;
}

void clt_clusters_finish(clt_clusters *clusters) {
  free(clusters->cluster);
  free(clusters->plane);
  free(clusters->root);
  free(clusters->order);
  *clusters = (clt_clusters){0};
}

clt_vector clt_cluster_point(const clt_clusters *clusters, int number, const double at[2]) {
  const clt_cluster *cluster = &clusters->cluster[number];
  const clt_plane *plane = &clusters->plane[cluster->surface];
  double place[2];
  for (int axis = 0; axis < 2; axis++) {
    place[axis] = 0.5 * ((1.0 - at[axis]) * cluster->low[axis] + (1.0 + at[axis]) * cluster->high[axis]);
  }
  return vec_along(plane->origin, place[0], plane->along[0], place[1], plane->along[1]);
}

void clt_cluster_corners(const clt_clusters *clusters, int number, clt_vector corners[4]) {
  const double at[4][2] = {{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}};
  for (int k = 0; k < 4; k++) {
    corners[k] = clt_cluster_point(clusters, number, at[k]);
  }
}

double clt_cluster_side(const clt_cluster *cluster) {
  return fmax(cluster->high[0] - cluster->low[0], cluster->high[1] - cluster->low[1]);
}
