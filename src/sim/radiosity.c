#include "sim/radiosity.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "sim/formfactor.h"
#include "sim/radiosity_solve.h"
#include "transport/kind.h"

/* Wanted error of the exchange of light, relative, and of the solution. */
static const double EXCHANGE_TOLERANCE = 1e-4, SOLVE_TOLERANCE = 1e-6;

/* A list of what cells have to do with elements, both ways round. */
typedef struct list {
  clt_sparse by_cell, by_element;
} list;

typedef struct radiosity {
  clt_layout layout; /* its lists are in those below */
  clt_hierarchy *hierarchy;
  int *place; /* of each element of the mesh in the hierarchy's order */
  list lights, sees, mirrors[CLT_SIM_CHANNELS_MAX];
  bool sees_what_it_lights;               /* `sees` is empty: it is `lights` */
  int mirror_plane[CLT_SIM_CHANNELS_MAX]; /* of each channel; -1: no gloss */
  clt_lanes *direct, *flux;               /* F and Phi / pi of each cell */
  clt_radiosity_system system;            /* D and the vectors of the solution */
  clt_lanes *shown, *driven, *thrown;     /* a product's cells, cells and elements */
  pthread_mutex_t lock;                   /* of the work space above */
} radiosity;

clt_mesh_size clt_radiosity_mesh_size(const clt_scene_description *description) {
  int cells = description->width * description->height;
  return (clt_mesh_size){.wanted = cells / 2, .most = cells + cells / 2};
}

static const clt_sparse *seen_by_cell(const radiosity *own) {
  return own->sees_what_it_lights ? &own->lights.by_cell : &own->sees.by_cell;
}

static const clt_sparse *seen_by_element(const radiosity *own) {
  return own->sees_what_it_lights ? &own->lights.by_element : &own->sees.by_element;
}

/* out += list x, only in the lanes of the channels whose gloss has this plane. */
static void add_plane(const radiosity *own, int plane, const clt_sparse *matrix, const clt_lanes *x, clt_lanes *work,
                      clt_lanes *out) {
  clt_lanes chosen = {0};
  for (int c = 0; c < own->layout.cells.channels; c++) {
    chosen[c] = own->mirror_plane[c] == plane ? 1.0f : 0.0f;
  }
  clt_sparse_product(matrix, x, NULL, work);
  for (int i = 0; i < matrix->rows; i++) {
    out[i] += chosen * work[i];
  }
}

/* y = T x of every lane: cells entries each. */
static void light(radiosity *own, const clt_lanes *x, clt_lanes *y) {
  clt_radiosity_system *system = &own->system;
  int cells = own->layout.cells.count;
  for (int j = 0; j < cells; j++) {
    own->driven[j] = own->flux[j] * x[j];
  }
  clt_sparse_product(&own->lights.by_element, own->driven, system->scale, system->source);
  clt_radiosity_solve(system, SOLVE_TOLERANCE);
  for (size_t e = 0; e < system->count; e++) {
    own->thrown[e] = system->scale[e] * system->bounced[e];
  }
  clt_sparse_product(seen_by_cell(own), own->thrown, NULL, y);
  for (int p = 0; p < CLT_SIM_CHANNELS_MAX; p++) {
    if (own->mirrors[p].by_cell.rows > 0) {
      for (size_t e = 0; e < system->count && p == 0; e++) {
        own->thrown[e] += system->scale[e] * system->source[e];
      }
      add_plane(own, p, &own->mirrors[p].by_cell, own->thrown, own->driven, y);
    }
  }
  for (int i = 0; i < cells; i++) {
    y[i] += own->direct[i] * x[i];
  }
}

/* x = T' y: the same way back. z = D (V + M)' y, and what M' y finds needs no bounce. */
static void light_back(radiosity *own, const clt_lanes *y, clt_lanes *x) {
  clt_radiosity_system *system = &own->system;
  clt_sparse_product(seen_by_element(own), y, system->scale, system->source);
  memset(own->thrown, 0, system->count * sizeof *own->thrown);
  for (int p = 0; p < CLT_SIM_CHANNELS_MAX; p++) {
    if (own->mirrors[p].by_element.rows > 0) {
      add_plane(own, p, &own->mirrors[p].by_element, y, system->bounced, own->thrown);
    }
  }
  for (size_t e = 0; e < system->count; e++) {
    own->thrown[e] *= system->scale[e];
    system->source[e] += own->thrown[e];
  }
  clt_radiosity_solve(system, SOLVE_TOLERANCE);
  for (size_t e = 0; e < system->count; e++) {
    own->thrown[e] = system->scale[e] * (own->thrown[e] + system->bounced[e]);
  }
  clt_sparse_product(&own->lights.by_cell, own->thrown, own->flux, x);
  for (int j = 0; j < own->layout.cells.count; j++) {
    x[j] += own->direct[j] * y[j];
  }
}

/* One product of `count` channels from `first` on, each a vector of the cells. */
static void run(const clt_transport *transport, int first, int count, const double *in, double *out,
                void (*product)(radiosity *, const clt_lanes *, clt_lanes *)) {
  radiosity *own = transport->storage;
  size_t cells = transport->cols;
  pthread_mutex_lock(&own->lock);
  clt_lanes *x = own->shown + cells, *y = own->shown;
  memset(x, 0, cells * sizeof *x);
  for (int c = 0; c < count; c++) {
    for (size_t j = 0; j < cells; j++) {
      x[j][first + c] = (float)in[(size_t)c * cells + j];
    }
  }
  product(own, x, y);
  for (int c = 0; c < count; c++) {
    for (size_t i = 0; i < cells; i++) {
      out[(size_t)c * cells + i] = (double)y[i][first + c];
    }
  }
  pthread_mutex_unlock(&own->lock);
}

static void apply(const clt_transport *transport, int channel, const double *x, double *y) {
  run(transport, channel, 1, x, y, light);
}

static void apply_all(const clt_transport *transport, const double *x, double *y) {
  run(transport, 0, transport->channels, x, y, light);
}

static void apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  run(transport, channel, 1, y, x, light_back);
}

static void diagonal(const clt_transport *transport, int channel, double *values) {
  const radiosity *own = transport->storage;
  for (size_t i = 0; i < transport->cols; i++) {
    values[i] = (double)own->direct[i][channel];
  }
}

static void row_sums(const clt_transport *transport, int channel, double *sums) {
  for (size_t i = 0; i < transport->rows; i++) {
    sums[i] = 1.0;
  }
  apply(transport, channel, sums, sums); /* run takes all of x before it writes y */
}

static size_t list_bytes(const list *of) {
  return clt_sparse_bytes(&of->by_cell) + clt_sparse_bytes(&of->by_element);
}

static size_t bytes(const clt_transport *transport) {
  const radiosity *own = transport->storage;
  size_t sum = clt_hierarchy_measure(own->hierarchy).bytes + list_bytes(&own->lights) + list_bytes(&own->sees);
  for (int p = 0; p < CLT_SIM_CHANNELS_MAX; p++) {
    sum += list_bytes(&own->mirrors[p]);
  }
  return sum + 2 * transport->cols * sizeof *own->direct;
}

static float *entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL;
}

static clt_status check(const clt_transport *transport, const char *source, clt_error *error) {
  (void)transport;
  (void)source;
  (void)error;
  return CLT_OK;
}

static clt_status load(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  (void)transport;
  (void)hdf;
  return clt_fail(error, CLT_BAD_INPUT, "the light of a scene is not read from a file");
}

static clt_status save(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  (void)hdf;
  return clt_fail(error, CLT_BAD_INPUT,
                  "the exact light of a scene of %zu cells is held as its geometry and cannot be saved; acquire it, or "
                  "take a grid of at most %d cells",
                  transport->cols, CLT_FINE_GRID);
}

static void list_finish(list *of) {
  clt_sparse_finish(&of->by_cell);
  clt_sparse_finish(&of->by_element);
}

static void destroy(clt_transport *transport) {
  radiosity *own = transport->storage;
  if (own == NULL) {
    return;
  }
  clt_layout_finish(&own->layout);
  clt_hierarchy_destroy(own->hierarchy);
  list_finish(&own->lights);
  list_finish(&own->sees);
  for (int p = 0; p < CLT_SIM_CHANNELS_MAX; p++) {
    list_finish(&own->mirrors[p]);
  }
  clt_radiosity_system_finish(&own->system);
  free(own->place);
  free(own->direct);
  free(own->shown);
  pthread_mutex_destroy(&own->lock);
  free(own);
}

static const clt_kind kind = {.name = "radiosity",
                              .apply = apply,
                              .apply_all = apply_all,
                              .apply_transposed = apply_transposed,
                              .diagonal = diagonal,
                              .row_sums = row_sums,
                              .bytes = bytes,
                              .entries = entries,
                              .check = check,
                              .load = load,
                              .save = save,
                              .destroy = destroy};

bool clt_radiosity_is(const clt_transport *transport) {
  return transport->kind == &kind;
}

static clt_status out_of_memory(const radiosity *own, clt_error *error) {
  return clt_fail(error, CLT_FAILED, "%s: out of memory for the light of %d cells; use a smaller grid",
                  own->layout.description->path, own->layout.cells.count);
}

static bool take_list(const clt_weights *lists, const int *place, int elements, list *out) {
  return clt_sparse_init(&out->by_cell, lists, place) &&
         clt_sparse_transpose(&out->by_cell, elements, &out->by_element);
}

/* The lists in the hierarchy's order of elements; those of the mesh are let go. */
static clt_status take_lists(radiosity *own, clt_error *error) {
  clt_mesh *mesh = &own->layout.mesh;
  bool enough = take_list(&mesh->lights, own->place, mesh->count, &own->lights);
  own->sees_what_it_lights = mesh->sees.start == mesh->lights.start;
  if (enough && !own->sees_what_it_lights) {
    enough = take_list(&mesh->sees, own->place, mesh->count, &own->sees);
  }
  for (int c = 0; c < CLT_SIM_CHANNELS_MAX && enough; c++) {
    own->mirror_plane[c] = mesh->mirrors[c].rows > 0 ? c : -1;
    for (int p = 0; p < c && own->mirror_plane[c] == c; p++) {
      own->mirror_plane[c] = mesh->mirrors[p].start == mesh->mirrors[c].start ? p : c;
    }
    if (own->mirror_plane[c] == c) {
      enough = take_list(&mesh->mirrors[c], own->place, mesh->count, &own->mirrors[c]);
    }
  }
  clt_mesh_drop_lists(mesh);
  return enough ? CLT_OK : out_of_memory(own, error);
}

/* F and Phi / pi, for drive above the panel's black. */
static clt_status take_cells(radiosity *own, clt_error *error) {
  const clt_cells *cells = &own->layout.cells;
  const clt_projector_description *projector = &own->layout.description->projector;
  size_t count = (size_t)cells->count, elements = (size_t)own->layout.mesh.count;
  own->direct = clt_alloc(2 * count, sizeof *own->direct);
  own->shown = clt_alloc(2 * count + (count > elements ? count : elements) + elements, sizeof *own->shown);
  if (own->direct == NULL || own->shown == NULL) {
    return out_of_memory(own, error);
  }
  own->flux = own->direct + count;
  own->driven = own->shown + 2 * count;
  own->thrown = own->driven + (count > elements ? count : elements);
  for (int c = 0; c < cells->channels; c++) {
    for (size_t i = 0; i < count; i++) {
      double above_black = 1.0 - projector->black;
      own->direct[i][c] = (float)(above_black * cells->direct[(size_t)c * count + i]);
      own->flux[i][c] = (float)(above_black * cells->solid_angle[i] * projector->intensity[c] / M_PI);
    }
  }
  return CLT_OK;
}

static clt_parts parts_of(const clt_layout *layout) {
  return (clt_parts){layout->description->surfaces,      layout->mesh.elements, layout->mesh.surface,
                     layout->description->surface_count, layout->mesh.count,    layout->visibility};
}

/* The hierarchy, and D in its order. */
static clt_status take_exchange(radiosity *own, clt_error *error) {
  const clt_mesh *mesh = &own->layout.mesh;
  clt_parts parts = parts_of(&own->layout);
  clt_status status = clt_hierarchy_create(&parts, EXCHANGE_TOLERANCE, &own->hierarchy, error);
  own->place = clt_alloc((size_t)mesh->count, sizeof *own->place);
  if (status == CLT_OK && (own->place == NULL || !clt_radiosity_system_init(&own->system, own->hierarchy))) {
    status = out_of_memory(own, error);
  }
  for (int k = 0; k < mesh->count && status == CLT_OK; k++) {
    int element = clt_hierarchy_order(own->hierarchy)[k];
    const clt_rectangle *of = &mesh->elements[element];
    own->place[element] = k;
    for (int c = 0; c < own->layout.cells.channels; c++) {
      own->system.scale[k][c] = (float)sqrt(of->albedo[c] / clt_rectangle_area(of));
    }
  }
  return status;
}

/* Whether something may stand between two surfaces that face each other. */
static bool may_be_parted(const clt_parts *parts, int a, int b) {
  return clt_rectangles_may_be_parted(parts->surfaces, parts->surface_count, a, b);
}

/* H_ij as exchange.c has it, not scaled. */
static double exact_exchange(const clt_parts *parts, int i, int j) {
  int a = parts->surface[i], b = parts->surface[j];
  if (a == b || !clt_rectangles_face(&parts->surfaces[a], &parts->surfaces[b])) {
    return 0.0;
  }
  int low = i < j ? i : j, high = i < j ? j : i;
  double visible = may_be_parted(parts, a, b) ? clt_exchange_visible(parts, low, high) : 1.0;
  return visible > 0.0 ? visible * clt_formfactor_exchange(&parts->elements[low], &parts->elements[high]) : 0.0;
}

/* D_k sum over f of H_kf D_f s_f of every lane: what element number k of the hierarchy receives, s = source + bounced.
 */
static void gather(const radiosity *own, int k, double received[CLT_LANES]) {
  const clt_radiosity_system *system = &own->system;
  const int *order = clt_hierarchy_order(own->hierarchy);
  clt_parts parts = parts_of(&own->layout);
  double sum[CLT_LANES] = {0.0};
  for (size_t f = 0; f < system->count; f++) {
    double exchanged = exact_exchange(&parts, order[k], order[f]);
    for (int lane = 0; lane < CLT_LANES && exchanged > 0.0; lane++) {
      sum[lane] += exchanged * (double)system->scale[f][lane] *
                   ((double)system->source[f][lane] + (double)system->bounced[f][lane]);
    }
  }
  for (int lane = 0; lane < CLT_LANES; lane++) {
    received[lane] = (double)system->scale[k][lane] * sum[lane];
  }
}

/* Radiance of the cell's direct light and of what the elements in its row received. */
static void gather_cell(const radiosity *own, int cell, const double *drive, double exact[CLT_LANES]) {
  const clt_sparse *sees = seen_by_cell(own);
  size_t cells = (size_t)own->layout.cells.count;
  for (int c = 0; c < own->layout.cells.channels; c++) {
    exact[c] = (double)own->direct[cell][c] * drive[(size_t)c * cells + (size_t)cell];
  }
  for (int k = sees->start[cell]; k < sees->start[cell + 1]; k++) {
    double received[CLT_LANES];
    gather(own, sees->column[k], received);
    for (int c = 0; c < own->layout.cells.channels; c++) {
      exact[c] += (double)sees->weight[k] * (double)own->system.scale[sees->column[k]][c] * received[c];
    }
  }
}

clt_status clt_radiosity_gather(const clt_transport *transport, const double *drive, const int *cells, int count,
                                double *simulated, double *exact, clt_error *error) {
  radiosity *own = transport->storage;
  size_t all = transport->cols, channels = (size_t)transport->channels;
  if (own->mirrors[0].by_cell.rows > 0) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: glossy light of more than %d cells is not gathered exactly; take a smaller grid or leave the "
                    "gloss out",
                    own->layout.description->path, CLT_FINE_GRID);
  }
  double *seen = clt_alloc(channels * all, sizeof *seen);
  if (seen == NULL) {
    return out_of_memory(own, error);
  }
  apply_all(transport, drive, seen);
  pthread_mutex_lock(&own->lock); /* source and bounced are those of this drive: the caller solves nothing meanwhile */
#pragma omp parallel for schedule(dynamic)
  for (int k = 0; k < count; k++) {
    double found[CLT_LANES] = {0.0};
    gather_cell(own, cells[k], drive, found);
    for (size_t c = 0; c < channels; c++) {
      simulated[c * (size_t)count + (size_t)k] = seen[c * all + (size_t)cells[k]];
      exact[c * (size_t)count + (size_t)k] = found[c];
    }
  }
  pthread_mutex_unlock(&own->lock);
  free(seen);
  return CLT_OK;
}

clt_status clt_radiosity_transport(clt_layout *layout, clt_transport **out, clt_error *error) {
  const clt_scene_description *description = layout->description;
  radiosity *own = clt_alloc(1, sizeof *own);
  if (own == NULL) {
    clt_layout_finish(layout);
    return clt_fail(error, CLT_FAILED, "%s: out of memory", description->path);
  }
  pthread_mutex_init(&own->lock, NULL);
  own->layout = *layout;
  *layout = (clt_layout){0};
  clt_transport *transport = NULL;
  clt_status status = clt_transport_begin(&kind, description->width, description->height, description->channels,
                                          description->path, &transport, error);
  if (status != CLT_OK) {
    clt_transport unmade = {.storage = own};
    destroy(&unmade);
    return status;
  }
  transport->storage = own;
  clt_status (*const steps[])(radiosity *, clt_error *) = {take_exchange, take_lists, take_cells};
  for (size_t k = 0; k < sizeof steps / sizeof steps[0] && status == CLT_OK; k++) {
    status = steps[k](own, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_set_rows(transport, (size_t)own->layout.cells.count, description->path, error);
  }
  if (status == CLT_OK) {
    status = clt_transport_keep_black(transport, error);
  }
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  *out = transport;
  return CLT_OK;
}
