/* Clusters of cells by mutual transport, each inverted on its own (Wetzstein & Bimber 2007).
 *
 * Alone, B^-1 b with B the blocks of S on the clusters leaves what light the clusters exchange, whatever that is. Here
 * it is the base of an iteration l <- l + omega B^-1 r whose omega makes the next residual least, omega = <r, q> / <q,
 * q> with q = S B^-1 r; then no step makes the residual larger, and where clusters exchange no light one step is exact.
 */
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "solve/matrix.h"
#include "solve/method.h"

enum {
  CLUSTER_MAX = 256, /* cells: the factors then take count * CLUSTER_MAX entries at most */
  EDGES_PER_CELL = 32,
  BUCKETS = 512, /* of magnitudes, 8 to a factor of 2, from 2^-48 up */
  BUCKETS_PER_OCTAVE = 8,
  LEAST_EXPONENT = -48,
  STALE_STEPS = 8
};
static const double STALE_FACTOR = 0.98; /* of a residual: eight steps that each gain less will not end */
static const double PASSES = 20;         /* over the entries, in numbers of y += a x, to find the clusters */
static const double ROUNDING = 1e-12;    /* a stop this low, relative to b, is for lack of digits */

typedef struct edge {
  float weight;
  uint32_t a, b;
} edge;

typedef struct clusters {
  size_t cells;       /* listed, those of a cluster side by side */
  size_t *cell;       /* their numbers in the grid */
  size_t count;       /* of clusters */
  size_t *first;      /* listed cell at which a cluster begins; count + 1 values */
  size_t *block;      /* entry at which its factor begins */
  double *factor;     /* LU of each block's transpose, as its rows lie */
  lapack_int *pivots; /* of each listed cell */
  double *brief;
} clusters;

/* The mutual transport of two cells: what light makes the way there and back. */
static double mutual(const clt_matrix *matrix, size_t i, size_t j) {
  double both = matrix->entries[i * matrix->count + j] * matrix->entries[j * matrix->count + i];
  return both > 0
             ? sqrt(both)
             : fmax(fabs(matrix->entries[i * matrix->count + j]), fabs(matrix->entries[j * matrix->count + i])) / 2;
}

static size_t bucket_of(double weight) {
  double place = BUCKETS_PER_OCTAVE * (log2(weight) - LEAST_EXPONENT);
  return place <= 0 ? 0 : place < BUCKETS ? (size_t)place : BUCKETS - 1;
}

/* The least bucket such that no more than `most` pairs lie in it and above; pairs in bucket 0 never count. */
static size_t choose_threshold(const clt_matrix *matrix, size_t most) {
  size_t held[BUCKETS] = {0}, sum = 0, bucket = BUCKETS;
  for (size_t i = 0; i < matrix->count; i++) {
    for (size_t j = 0; j < i; j++) {
      double weight = mutual(matrix, i, j);
      held[weight > 0 ? bucket_of(weight) : 0]++;
    }
  }
  while (bucket > 1 && sum + held[bucket - 1] <= most) {
    sum += held[--bucket];
  }
  return bucket;
}

static size_t list_edges(const clt_matrix *matrix, size_t least, size_t most, edge *edges) {
  size_t kept = 0;
  for (size_t i = 0; i < matrix->count; i++) {
    for (size_t j = 0; j < i && kept < most; j++) {
      double weight = mutual(matrix, i, j);
      if (weight > 0 && bucket_of(weight) >= least) {
        edges[kept++] = (edge){(float)weight, (uint32_t)i, (uint32_t)j};
      }
    }
  }
  return kept;
}

/* Strongest first; then by place, so that the order is one. */
static int compare_edges(const void *left, const void *right) {
  const edge *a = left, *b = right;
  if (a->weight != b->weight) {
    return a->weight < b->weight ? 1 : -1;
  }
  return a->a != b->a ? (a->a > b->a) - (a->a < b->a) : (a->b > b->b) - (a->b < b->b);
}

static size_t root_of(size_t *parent, size_t i) {
  while (parent[i] != i) {
    i = parent[i] = parent[parent[i]];
  }
  return i;
}

/* Joins along edges, the strongest first, while a cluster stays within CLUSTER_MAX. */
static void join(size_t *parent, size_t *size, const edge *edges, size_t count) {
  for (size_t e = 0; e < count; e++) {
    size_t a = root_of(parent, edges[e].a), b = root_of(parent, edges[e].b);
    if (a != b && size[a] + size[b] <= CLUSTER_MAX) {
      size_t low = a < b ? a : b, high = a < b ? b : a;
      parent[high] = low;
      size[low] += size[high];
    }
  }
}

/* Lists the clusters' cells side by side; order[k] is the place in the matrix of listed cell k. */
static void list_clusters(clusters *of, const clt_matrix *matrix, size_t *parent, size_t *size, size_t *order) {
  size_t entries = 0;
  for (size_t i = 0; i < of->cells; i++) {
    if (root_of(parent, i) == i) {
      of->first[of->count + 1] = of->first[of->count] + size[i];
      of->block[of->count] = entries;
      entries += size[i] * size[i];
      size[i] = of->first[of->count++]; /* from here on: where its next cell goes */
    }
  }
  of->block[of->count] = entries;
  for (size_t i = 0; i < of->cells; i++) {
    size_t place = size[root_of(parent, i)]++;
    order[place] = i;
    of->cell[place] = matrix->cell[i];
  }
}

static clt_status factor_blocks(clusters *of, const clt_matrix *matrix, const size_t *order, clt_error *error) {
  of->factor = clt_alloc(of->block[of->count], sizeof *of->factor);
  if (of->factor == NULL) {
    return clt_fail(error, CLT_FAILED, "clusters: not enough memory for the factors of %zu clusters", of->count);
  }
  for (size_t c = 0; c < of->count; c++) {
    size_t first = of->first[c], n = of->first[c + 1] - first;
    double *block = of->factor + of->block[c];
    for (size_t k = 0; k < n * n; k++) {
      block[k] = matrix->entries[order[first + k / n] * matrix->count + order[first + k % n]];
    }
    lapack_int size = (lapack_int)n;
    if (LAPACKE_dgetrf(LAPACK_COL_MAJOR, size, size, block, size, of->pivots + first) != 0) {
      return clt_fail(error, CLT_BAD_INPUT, "clusters: the cluster of cell %zu has no inverse; use lsmr or auto",
                      of->cell[first]);
    }
  }
  return CLT_OK;
}

/* Scratch of the making: three lists over the cells, and the edges. */
typedef struct scratch {
  size_t *parent, *size, *order;
  edge *edges;
  size_t most;
} scratch;

static void scratch_finish(scratch *work) {
  free(work->parent);
  free(work->size);
  free(work->order);
  free(work->edges);
}

static clt_status reserve(clusters *of, scratch *work, size_t cells, clt_error *error) {
  of->cells = cells;
  of->cell = clt_alloc(cells, sizeof *of->cell);
  of->first = clt_alloc(cells + 1, sizeof *of->first);
  of->block = clt_alloc(cells + 1, sizeof *of->block);
  of->pivots = clt_alloc(cells, sizeof *of->pivots);
  of->brief = clt_alloc(cells, sizeof *of->brief);
  work->most = EDGES_PER_CELL * cells;
  work->parent = clt_alloc(cells, sizeof *work->parent);
  work->size = clt_alloc(cells, sizeof *work->size);
  work->order = clt_alloc(cells, sizeof *work->order);
  work->edges = clt_alloc(work->most, sizeof *work->edges);
  bool whole = of->cell != NULL && of->first != NULL && of->block != NULL && of->pivots != NULL && of->brief != NULL &&
               work->parent != NULL && work->size != NULL && work->order != NULL && work->edges != NULL;
  return whole ? CLT_OK
               : clt_fail(error, CLT_FAILED, "clusters: not enough memory for lists of %zu cells; use pcg or gmres",
                          cells);
}

static clt_status build(clusters *of, scratch *work, const clt_matrix *matrix, clt_error *error) {
  for (size_t i = 0; i < matrix->count; i++) {
    work->parent[i] = i;
    work->size[i] = 1;
  }
  size_t least = choose_threshold(matrix, work->most);
  size_t kept = list_edges(matrix, least, work->most, work->edges);
  qsort(work->edges, kept, sizeof *work->edges, compare_edges);
  join(work->parent, work->size, work->edges, kept);
  list_clusters(of, matrix, work->parent, work->size, work->order);
  return factor_blocks(of, matrix, work->order, error);
}

static clt_status prepare(clt_system *system, void **prepared, clt_error *error) {
  clusters *of = *prepared = clt_alloc(1, sizeof *of);
  if (of == NULL) {
    return clt_fail(error, CLT_FAILED, "clusters: not enough memory");
  }
  clt_matrix matrix = {0};
  scratch work = {0};
  clt_status status = clt_matrix_init(&matrix, system, "clusters", error);
  if (status == CLT_OK) {
    status = reserve(of, &work, matrix.count, error);
  }
  if (status == CLT_OK) {
    status = build(of, &work, &matrix, error);
  }
  scratch_finish(&work);
  clt_matrix_finish(&matrix);
  return status;
}

static void release(void *prepared) {
  clusters *of = prepared;
  if (of == NULL) {
    return;
  }
  free(of->cell);
  free(of->first);
  free(of->block);
  free(of->factor);
  free(of->pivots);
  free(of->brief);
  free(of);
}

/* d = B^-1 r at lit cells */
static void apply(clusters *of, const double *r, double *d) {
  for (size_t c = 0; c < of->count; c++) {
    size_t first = of->first[c], n = of->first[c + 1] - first;
    for (size_t k = first; k < first + n; k++) {
      of->brief[k] = r[of->cell[k]];
    }
    LAPACKE_dgetrs_work(LAPACK_COL_MAJOR, 'T', (lapack_int)n, 1, of->factor + of->block[c], (lapack_int)n,
                        of->pivots + first, of->brief + first, (lapack_int)n);
    for (size_t k = first; k < first + n; k++) {
      d[of->cell[k]] = of->brief[k];
    }
  }
}

/* How a run ends that gains nothing any more: at the residual that the recurrence may have lost to rounding, or short.
 */
static clt_outcome end_stale(const clt_system *system, const clusters *of, double norm, clt_run *run) {
  if (norm <= ROUNDING * system->wanted_norm) {
    return CLT_RUN_STOPPED;
  }
  clt_run_note(run, "%zu clusters leave %.2g of the target to the light between them", of->count,
               norm / system->wanted_norm);
  return CLT_RUN_BROKE;
}

static clt_outcome run_clusters(clt_system *system, clt_run *run) {
  clusters *of = system->prepared;
  double *r = clt_system_vector(system, 0), *d = clt_system_vector(system, 1), *q = clt_system_vector(system, 2);
  double norm = clt_system_residual(system, system->light, r);
  int stale = 0;
  memset(d, 0, system->cols * sizeof *d);
  clt_run_open(run, norm);
  while (norm > clt_run_target(run, system)) {
    if (!clt_run_may_go_on(run)) {
      return CLT_RUN_STOPPED;
    }
    apply(of, r, d);
    clt_system_apply(system, d, q);
    double size = clt_dot(system->rows, q, q), omega = size > 0 ? clt_dot(system->rows, r, q) / size : 0, before = norm;
    clt_add(system->cols, omega, d, system->light);
    clt_add(system->rows, -omega, q, r);
    norm = clt_norm(system->rows, r);
    if (norm <= clt_run_target(run, system) || norm > STALE_FACTOR * before) {
      norm = clt_system_residual(system, system->light, r);
    }
    clt_run_count(run, norm);
    stale = norm <= STALE_FACTOR * before ? 0 : stale + 1;
    if (stale >= STALE_STEPS || !isfinite(norm)) {
      return end_stale(system, of, norm, run);
    }
  }
  return CLT_RUN_CONVERGED;
}

/* Measured on cubes of albedo .2 to .99: a step leaves .1 to .8 of the residual, near Chebyshev's q = m / (1 + sqrt(1 -
 * m^2)); a single cluster is exact. */
static void expect(clt_effort *effort) {
  double n = (double)effort->model->cells, size = fmin(n, CLUSTER_MAX);
  double m = effort->channel->radius_high / (1 + effort->channel->radius_high);
  clt_effort_steady(effort, n <= CLUSTER_MAX ? 1e-14 : m / (1 + sqrt(1 - m * m)));
  clt_effort_take(effort, 3, 1, size + 4);
  clt_effort_prepare(effort, 2 * n * size * size / 3);
  effort->prepare_s += PASSES * n * effort->model->vector_s;
}

const clt_method clt_method_clusters = {
    .name = "clusters",
    .summary = "clusters of at most 256 cells that light each other most, each inverted on its own (Wetzstein & Bimber "
               "2007), iterated for the light between them; up to 12288 lit cells",
    .apart = true,
    .invests = true,
    .vectors = 3,
    .prepare = prepare,
    .release = release,
    .expect = expect,
    .run = run_clusters,
};
