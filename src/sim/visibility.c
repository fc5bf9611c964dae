#include "sim/visibility.h"

#include <embree3/rtcore.h>
#include <stdlib.h>

#include "base/memory.h"

/* Tried one by one; more are given to Embree. */
enum { FEW = 8 };

struct clt_visibility {
  const clt_rectangle *surfaces;
  int count;
  RTCDevice device; /* NULL where there are few surfaces */
  RTCScene scene;
};

/* A ray that passes through two surfaces as if they were not there. */
typedef struct passing {
  struct RTCIntersectContext context;
  unsigned a, b;
} passing;

static void let_pass(const struct RTCFilterFunctionNArguments *asked) {
  enum { SURFACE = 5 }; /* which of a hit's fields, N values each, is its primID */
  const passing *through = (const passing *)(const void *)asked->context;
  const unsigned *met = (const unsigned *)(const void *)asked->hit + SURFACE * asked->N;
  for (unsigned k = 0; k < asked->N; k++) {
    if (met[k] == through->a || met[k] == through->b) {
      asked->valid[k] = 0;
    }
  }
}

static passing pass_through(int a, int b) {
  passing through = {.a = (unsigned)a, .b = (unsigned)b};
  rtcInitIntersectContext(&through.context);
  through.context.filter = let_pass;
  return through;
}

/* One Embree quadrilateral for each surface, in their order. */
static bool fill_geometry(const clt_visibility *visibility, RTCGeometry geometry) {
  size_t count = (size_t)visibility->count;
  float *points =
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof *points, 4 * count);
  unsigned *corners =
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 4 * sizeof *corners, count);
  if (points == NULL || corners == NULL) {
    return false;
  }
  for (size_t k = 0; k < 4 * count; k++) {
    clt_vector at = clt_rectangle_vertex(&visibility->surfaces[k / 4], (int)(k % 4));
    points[3 * k] = (float)at.x;
    points[3 * k + 1] = (float)at.y;
    points[3 * k + 2] = (float)at.z;
    corners[k] = (unsigned)k;
  }
  rtcCommitGeometry(geometry);
  return true;
}

static bool build_scene(clt_visibility *visibility) {
  visibility->device = rtcNewDevice("threads=1,set_affinity=0");
  visibility->scene = visibility->device != NULL ? rtcNewScene(visibility->device) : NULL;
  RTCGeometry geometry = visibility->scene != NULL ? rtcNewGeometry(visibility->device, RTC_GEOMETRY_TYPE_QUAD) : NULL;
  if (geometry == NULL) {
    return false;
  }
  bool filled = fill_geometry(visibility, geometry);
  rtcAttachGeometry(visibility->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcSetSceneFlags(visibility->scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
  rtcCommitScene(visibility->scene);
  return filled && rtcGetDeviceError(visibility->device) == RTC_ERROR_NONE;
}

clt_status clt_visibility_create(const clt_rectangle *surfaces, int count, clt_visibility **out, clt_error *error) {
  clt_visibility *visibility = clt_alloc(1, sizeof *visibility);
  if (visibility == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for tracing rays");
  }
  *visibility = (clt_visibility){.surfaces = surfaces, .count = count};
  if (count > FEW && !build_scene(visibility)) {
    clt_visibility_destroy(visibility);
    return clt_fail(error, CLT_FAILED, "Embree cannot take %d surfaces; memory may be short", count);
  }
  *out = visibility;
  return CLT_OK;
}

void clt_visibility_destroy(clt_visibility *visibility) {
  if (visibility != NULL) {
    if (visibility->scene != NULL) {
      rtcReleaseScene(visibility->scene);
    }
    if (visibility->device != NULL) {
      rtcReleaseDevice(visibility->device);
    }
    free(visibility);
  }
}

static struct RTCRay ray_along(clt_vector origin, clt_vector direction, double near, double far) {
  return (struct RTCRay){.org_x = (float)origin.x,
                         .org_y = (float)origin.y,
                         .org_z = (float)origin.z,
                         .dir_x = (float)direction.x,
                         .dir_y = (float)direction.y,
                         .dir_z = (float)direction.z,
                         .tnear = (float)near,
                         .tfar = (float)far,
                         .mask = ~0u};
}

clt_hit clt_visibility_first_hit(const clt_visibility *visibility, clt_vector origin, clt_vector direction,
                                 int leaving) {
  if (visibility->scene == NULL) {
    return clt_first_hit(visibility->surfaces, visibility->count, origin, direction, leaving);
  }
  struct RTCRayHit ray = {.ray = ray_along(origin, direction, 0.0, INFINITY),
                          .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID}};
  passing through = pass_through(leaving, leaving);
  rtcIntersect1(visibility->scene, &through.context, &ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
    return (clt_hit){.surface = -1, .distance = INFINITY};
  }
  clt_hit hit = clt_hit_on_plane(&visibility->surfaces[ray.hit.primID], origin, direction);
  hit.surface = (int)ray.hit.primID;
  return hit;
}

/* Single precision: a surface that touches an end of a segment within this part of it is not between. */
static const double TOUCHING = 1e-6;

bool clt_visibility_blocked(const clt_visibility *visibility, clt_vector from, clt_vector to, int a, int b) {
  if (visibility->scene == NULL) {
    return clt_segment_blocked(visibility->surfaces, visibility->count, from, to, a, b);
  }
  struct RTCRay ray = ray_along(from, vec_sub(to, from), TOUCHING, 1.0 - TOUCHING);
  passing through = pass_through(a, b);
  rtcOccluded1(visibility->scene, &through.context, &ray);
  return ray.tfar < 0.0f;
}

static void set_segment(struct RTCRay16 *rays, int k, clt_vector from, clt_vector to) {
  struct RTCRay ray = ray_along(from, vec_sub(to, from), TOUCHING, 1.0 - TOUCHING);
  rays->org_x[k] = ray.org_x;
  rays->org_y[k] = ray.org_y;
  rays->org_z[k] = ray.org_z;
  rays->dir_x[k] = ray.dir_x;
  rays->dir_y[k] = ray.dir_y;
  rays->dir_z[k] = ray.dir_z;
  rays->tnear[k] = ray.tnear;
  rays->tfar[k] = ray.tfar;
  rays->mask[k] = ray.mask;
}

int clt_visibility_open(const clt_visibility *visibility, const clt_vector from[CLT_SEGMENTS],
                        const clt_vector to[CLT_SEGMENTS], int a, int b) {
  int open = 0;
  if (visibility->scene == NULL) {
    for (int k = 0; k < CLT_SEGMENTS; k++) {
      open += !clt_segment_blocked(visibility->surfaces, visibility->count, from[k], to[k], a, b);
    }
    return open;
  }
  RTC_ALIGN(64) int valid[CLT_SEGMENTS];
  struct RTCRay16 rays = {.time = {0.0f}};
  for (int k = 0; k < CLT_SEGMENTS; k++) {
    valid[k] = -1;
    set_segment(&rays, k, from[k], to[k]);
  }
  passing through = pass_through(a, b);
  through.context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded16(valid, visibility->scene, &through.context, &rays);
  for (int k = 0; k < CLT_SEGMENTS; k++) {
    open += !(rays.tfar[k] < 0.0f);
  }
  return open;
}
