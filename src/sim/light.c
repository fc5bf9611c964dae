#include "sim/light.h"

#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/exchange.h"

clt_status clt_light_init(clt_light *light, const clt_scene_description *description, clt_error *error) {
  light->description = description;
  light->solved = -1;
  clt_status status =
      clt_visibility_create(description->surfaces, description->surface_count, &light->visibility, error);
  if (status == CLT_OK) {
    status = clt_mesh_init(&light->mesh, description, light->visibility, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  const clt_mesh *mesh = &light->mesh;
  size_t count = (size_t)mesh->count, lit = (size_t)mesh->lit;
  light->exchange = clt_alloc(count * count, sizeof *light->exchange);
  light->bounced = clt_alloc(lit * lit, sizeof *light->bounced);
  if (!light->exchange || !light->bounced) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for %zu surface elements", description->path, count);
  }
  clt_parts parts = {description->surfaces,      mesh->elements, mesh->surface,
                     description->surface_count, mesh->count,    light->visibility};
  return clt_exchange_compute(&parts, light->exchange, error);
}

void clt_light_finish(clt_light *light) {
  clt_mesh_finish(&light->mesh);
  clt_visibility_destroy(light->visibility);
  free(light->exchange);
  free(light->bounced);
  *light = (clt_light){.solved = -1};
}

static bool same_albedo(const clt_scene_description *description, int a, int b) {
  for (int k = 0; k < description->surface_count; k++) {
    if (description->surfaces[k].albedo[a] != description->surfaces[k].albedo[b]) {
      return false;
    }
  }
  return true;
}

/* D of one element. */
static double scaling(const clt_mesh *mesh, int channel, size_t element) {
  const clt_rectangle *of = &mesh->elements[element];
  return sqrt(of->albedo[channel] / clt_rectangle_area(of));
}

/* I - K into the lower triangle: entry (i, j), i > j, from H's (j, i), tile by tile. */
static void fill_system(clt_light *light, int channel) {
  enum { TILE = 64 };
  const clt_mesh *mesh = &light->mesh;
  size_t count = (size_t)mesh->count;
#pragma omp parallel for schedule(dynamic)
  for (size_t tile = 0; tile < count; tile += TILE) {
    size_t end = tile + TILE < count ? tile + TILE : count;
    for (size_t i = tile; i < count; i++) {
      double scale = scaling(mesh, channel, i);
      for (size_t j = tile; j < end && j < i; j++) {
        light->exchange[j * count + i] = -scale * scaling(mesh, channel, j) * light->exchange[i * count + j];
      }
    }
    for (size_t j = tile; j < end; j++) {
      light->exchange[j * count + j] = 1.0;
    }
  }
}

/* D ((I - K)^-1 - I) D from the inverse in the lower triangle of the trailing block, both triangles. */
static void keep_bounced(clt_light *light, int channel) {
  const clt_mesh *mesh = &light->mesh;
  size_t count = (size_t)mesh->count, lit = (size_t)mesh->lit, first = count - lit;
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t j = 0; j < lit; j++) {
    const double *column = &light->exchange[(first + j) * count + first];
    double scale = scaling(mesh, channel, first + j);
    for (size_t i = j; i < lit; i++) {
      double value = (column[i] - (i == j)) * scale * scaling(mesh, channel, first + i);
      light->bounced[j * lit + i] = light->bounced[i * lit + j] = value;
    }
  }
}

clt_status clt_light_solve(clt_light *light, int channel, clt_error *error) {
  if (light->solved >= 0 && same_albedo(light->description, light->solved, channel)) {
    return CLT_OK;
  }
  const clt_mesh *mesh = &light->mesh;
  size_t first = (size_t)(mesh->count - mesh->lit);
  fill_system(light, channel);
  int failed = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', mesh->count, light->exchange, mesh->count);
  double *trailing = &light->exchange[first * (size_t)mesh->count + first];
  if (failed == 0) {
    failed = LAPACKE_dpotri(LAPACK_COL_MAJOR, 'L', mesh->lit, trailing, mesh->count);
  }
  if (failed != 0) {
    return clt_fail(error, CLT_FAILED, "%s: the light of channel %d could not be solved (LAPACK says %d)",
                    light->description->path, channel, failed);
  }
  keep_bounced(light, channel);
  light->solved = channel;
  return CLT_OK;
}

double clt_light_direct(const clt_light *light, int channel, int i) {
  const clt_scene_description *description = light->description;
  const clt_ray_end *ends = &light->mesh.ends[(size_t)i * (size_t)light->mesh.rays];
  double sum = 0.0;
  for (int ray = 0; ray < light->mesh.rays; ray++) {
    if (ends[ray].surface >= 0) {
      sum += ends[ray].share * ends[ray].falloff * description->surfaces[ends[ray].surface].albedo[channel];
    }
  }
  return sum * description->projector.intensity[channel] / M_PI;
}

/* With W the weights, radiosity B = bounced W_j' intensity omega_j, and row i sees W_i B / pi. */
void clt_light_row(const clt_light *light, int channel, int i, double *row, double *scratch) {
  const clt_mesh *mesh = &light->mesh;
  size_t lit = (size_t)mesh->lit;
  int first = mesh->count - mesh->lit;
  memset(scratch, 0, lit * sizeof *scratch);
  for (int k = mesh->start[i]; k < mesh->start[i + 1]; k++) {
    const double *from = &light->bounced[(size_t)(mesh->element[k] - first) * lit];
    for (size_t e = 0; e < lit; e++) {
      scratch[e] += mesh->weight[k] * from[e];
    }
  }
  double intensity = light->description->projector.intensity[channel];
  for (int j = 0; j < mesh->cells; j++) {
    double sum = 0.0;
    for (int k = mesh->start[j]; k < mesh->start[j + 1]; k++) {
      sum += mesh->weight[k] * scratch[mesh->element[k] - first];
    }
    row[j] = sum * mesh->solid_angle[j] * intensity / M_PI;
  }
  row[i] += clt_light_direct(light, channel, i);
}

static clt_status fill_channel(clt_light *light, int channel, float *entries, clt_error *error) {
  size_t cells = (size_t)light->mesh.cells, lit = (size_t)light->mesh.lit;
  double above_black = 1.0 - light->description->projector.black;
  bool short_of_memory = false;
#pragma omp parallel reduction(|| : short_of_memory)
  {
    double *row = clt_alloc(cells + lit, sizeof *row);
    short_of_memory = row == NULL;
#pragma omp for schedule(static)
    for (size_t i = 0; i < cells; i++) {
      if (row != NULL) {
        clt_light_row(light, channel, (int)i, row, row + cells);
        for (size_t j = 0; j < cells; j++) {
          entries[i * cells + j] = (float)(above_black * row[j]);
        }
      }
    }
    free(row);
  }
  return short_of_memory ? clt_fail(error, CLT_FAILED, "%s: out of memory", light->description->path) : CLT_OK;
}

clt_status clt_light_transport(const clt_scene_description *description, clt_transport **out, clt_error *error) {
  clt_light light = {.solved = -1};
  clt_transport *transport = NULL;
  size_t cells = (size_t)description->width * (size_t)description->height;
  clt_status status = clt_light_init(&light, description, error);
  if (status == CLT_OK) {
    status = clt_transport_create_dense(description->width, description->height, description->channels, cells,
                                        &transport, error);
  }
  for (int c = 0; c < description->channels && status == CLT_OK; c++) {
    status = clt_light_solve(&light, c, error);
    if (status == CLT_OK) {
      status = fill_channel(&light, c, clt_transport_entries(transport, c), error);
    }
  }
  clt_light_finish(&light);
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  *out = transport;
  return CLT_OK;
}
