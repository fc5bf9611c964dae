#include "sim/light.h"

#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/exchange.h"
#include "sim/radiosity.h"

clt_status clt_light_init(clt_light *light, const clt_scene_description *description, clt_error *error) {
  const clt_mesh_size size = {.wanted = CLT_ELEMENTS_WANTED, .most = CLT_ELEMENTS_MAX};
  light->solved = -1;
  clt_status status = clt_layout_init(&light->layout, description, size, error);
  const clt_mesh *mesh = &light->layout.mesh;
  if (status != CLT_OK || mesh->count == 0) {
    return status;
  }
  size_t count = (size_t)mesh->count, used = (size_t)mesh->used;
  light->exchange = clt_alloc(count * count, sizeof *light->exchange);
  light->bounced = clt_alloc(used * used, sizeof *light->bounced);
  if (!light->exchange || !light->bounced) {
    return clt_fail(error, CLT_FAILED, "%s: out of memory for %zu surface elements", description->path, count);
  }
  clt_parts parts = {description->surfaces,      mesh->elements, mesh->surface,
                     description->surface_count, mesh->count,    light->layout.visibility};
  return clt_exchange_compute(&parts, light->exchange, error);
}

void clt_light_finish(clt_light *light) {
  clt_layout_finish(&light->layout);
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
  const clt_mesh *mesh = &light->layout.mesh;
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
  const clt_mesh *mesh = &light->layout.mesh;
  size_t count = (size_t)mesh->count, used = (size_t)mesh->used, first = count - used;
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t j = 0; j < used; j++) {
    const double *column = &light->exchange[(first + j) * count + first];
    double scale = scaling(mesh, channel, first + j);
    for (size_t i = j; i < used; i++) {
      double value = (column[i] - (i == j)) * scale * scaling(mesh, channel, first + i);
      light->bounced[j * used + i] = light->bounced[i * used + j] = value;
    }
  }
}

clt_status clt_light_solve(clt_light *light, int channel, clt_error *error) {
  if (light->solved >= 0 && same_albedo(light->layout.description, light->solved, channel)) {
    return CLT_OK;
  }
  const clt_mesh *mesh = &light->layout.mesh;
  if (mesh->count == 0) {
    light->solved = channel;
    return CLT_OK;
  }
  size_t first = (size_t)(mesh->count - mesh->used);
  fill_system(light, channel);
  int failed = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', mesh->count, light->exchange, mesh->count);
  double *trailing = &light->exchange[first * (size_t)mesh->count + first];
  if (failed == 0) {
    failed = LAPACKE_dpotri(LAPACK_COL_MAJOR, 'L', mesh->used, trailing, mesh->count);
  }
  if (failed != 0) {
    return clt_fail(error, CLT_FAILED, "%s: the light of channel %d could not be solved (LAPACK says %d)",
                    light->layout.description->path, channel, failed);
  }
  keep_bounced(light, channel);
  light->solved = channel;
  return CLT_OK;
}

double clt_light_direct(const clt_light *light, int channel, int i) {
  const clt_cells *cells = &light->layout.cells;
  return cells->direct[(size_t)channel * (size_t)cells->count + (size_t)i];
}

/* to += sum over row i of the list of weight * bounced */
static void add_bounced(const clt_light *light, const clt_weights *list, int i, double *to) {
  const clt_mesh *mesh = &light->layout.mesh;
  size_t used = (size_t)mesh->used;
  int first = mesh->count - mesh->used;
  for (int k = list->start[i]; k < list->start[i + 1]; k++) {
    const double *from = &light->bounced[(size_t)(list->element[k] - first) * used];
    for (size_t e = 0; e < used; e++) {
      to[e] += list->weight[k] * from[e];
    }
  }
}

/* view = bounced (V_i + M_i)' + diag(albedo / area) M_i' */
static void view_of(const clt_light *light, int channel, int i, double *view) {
  const clt_mesh *mesh = &light->layout.mesh;
  const clt_weights *mirrors = &mesh->mirrors[channel];
  int first = mesh->count - mesh->used;
  memset(view, 0, (size_t)mesh->used * sizeof *view);
  add_bounced(light, &mesh->sees, i, view);
  if (mirrors->rows > 0) {
    add_bounced(light, mirrors, i, view);
    for (int k = mirrors->start[i]; k < mirrors->start[i + 1]; k++) {
      double scale = scaling(mesh, channel, (size_t)mirrors->element[k]);
      view[mirrors->element[k] - first] += mirrors->weight[k] * scale * scale;
    }
  }
}

/* T_ij = F_i [i = j] + view_i W_j' solid_angle_j intensity / pi */
void clt_light_row(const clt_light *light, int channel, int i, double *row, double *scratch) {
  const clt_mesh *mesh = &light->layout.mesh;
  const clt_cells *cells = &light->layout.cells;
  const clt_weights *lights = &mesh->lights;
  int first = mesh->count - mesh->used;
  double intensity = light->layout.description->projector.intensity[channel];
  memset(row, 0, (size_t)cells->count * sizeof *row);
  if (mesh->count > 0) {
    view_of(light, channel, i, scratch);
    for (int j = 0; j < cells->count; j++) {
      double sum = 0.0;
      for (int k = lights->start[j]; k < lights->start[j + 1]; k++) {
        sum += lights->weight[k] * scratch[lights->element[k] - first];
      }
      row[j] = sum * cells->solid_angle[j] * intensity / M_PI;
    }
  }
  row[i] += clt_light_direct(light, channel, i);
}

static clt_status fill_channel(clt_light *light, int channel, float *entries, clt_error *error) {
  size_t cells = (size_t)light->layout.cells.count, used = (size_t)light->layout.mesh.used;
  double above_black = 1.0 - light->layout.description->projector.black;
  bool short_of_memory = false;
#pragma omp parallel reduction(|| : short_of_memory)
  {
    double *row = clt_alloc(cells + used, sizeof *row);
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
  return short_of_memory ? clt_fail(error, CLT_FAILED, "%s: out of memory", light->layout.description->path) : CLT_OK;
}

static clt_status make_dense(clt_light *light, clt_transport **out, clt_error *error) {
  const clt_scene_description *description = light->layout.description;
  clt_status status = clt_transport_create_dense(description->width, description->height, description->channels,
                                                 (size_t)light->layout.cells.count, out, error);
  for (int c = 0; c < description->channels && status == CLT_OK; c++) {
    status = clt_light_solve(light, c, error);
    if (status == CLT_OK) {
      status = fill_channel(light, c, clt_transport_entries(*out, c), error);
    }
  }
  return status;
}

/* Row i is F_i at cell i, which is node number i of the pyramid. */
static clt_status make_diagonal(const clt_layout *layout, clt_transport **out, clt_error *error) {
  const clt_scene_description *description = layout->description;
  size_t cells = (size_t)layout->cells.count, values = cells * (size_t)description->channels;
  int64_t *start = clt_alloc(cells + 1, sizeof *start);
  int32_t *node = clt_alloc(cells, sizeof *node);
  float *value = clt_alloc(values, sizeof *value);
  clt_status status = CLT_FAILED;
  if (start && node && value) {
    for (size_t i = 0; i < cells; i++) {
      start[i + 1] = (int64_t)i + 1;
      node[i] = (int32_t)i;
    }
    for (size_t k = 0; k < values; k++) {
      value[k] = (float)((1.0 - description->projector.black) * layout->cells.direct[k]);
    }
    status = clt_transport_create_tree(description->width, description->height, description->channels, cells, start,
                                       node, value, out, error);
  } else {
    status = clt_fail(error, CLT_FAILED, "%s: out of memory", description->path);
  }
  free(start);
  free(node);
  free(value);
  return status;
}

static clt_status find_facts(const clt_layout *layout, clt_light_facts *facts, clt_error *error) {
  *facts = (clt_light_facts){
      .facing = layout->sights.facing, .exchanging = layout->sights.exchanging, .glossy = layout->sights.glossy};
  return clt_occlusion_find(layout->description, layout->visibility, &layout->cells, &facts->occlusion, error);
}

static clt_status few_cells(const clt_scene_description *description, clt_transport **out, clt_light_facts *facts,
                            clt_error *error) {
  clt_light light = {.solved = -1};
  clt_status status = clt_light_init(&light, description, error);
  if (status == CLT_OK) {
    status = find_facts(&light.layout, facts, error);
  }
  if (status == CLT_OK) {
    status = light.layout.mesh.count > 0 ? make_dense(&light, out, error) : make_diagonal(&light.layout, out, error);
  }
  clt_light_finish(&light);
  return status;
}

static clt_status many_cells(const clt_scene_description *description, clt_transport **out, clt_light_facts *facts,
                             clt_error *error) {
  clt_layout layout = {0};
  clt_status status = clt_layout_init(&layout, description, clt_radiosity_mesh_size(description), error);
  if (status == CLT_OK) {
    status = find_facts(&layout, facts, error);
  }
  if (status == CLT_OK) {
    status = layout.mesh.count > 0 ? clt_radiosity_transport(&layout, out, error) : make_diagonal(&layout, out, error);
  }
  clt_layout_finish(&layout);
  return status;
}

clt_status clt_light_transport(const clt_scene_description *description, clt_transport **out, clt_light_facts *facts,
                               clt_error *error) {
  clt_transport *transport = NULL;
  bool few = description->width * description->height <= CLT_FINE_GRID;
  clt_status status =
      few ? few_cells(description, &transport, facts, error) : many_cells(description, &transport, facts, error);
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  *out = transport;
  return CLT_OK;
}
