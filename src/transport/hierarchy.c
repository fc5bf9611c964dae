/* Products with hierarchy storage. */
#include "transport/hierarchy.h"

#include <string.h>

#include "base/turns.h"
#include "transport/kernels.h"

enum { WORTH_SHARING = 16384 }; /* cells from which threads pay */

/* One side of the far light: what cells are multiplied by, and the factor between leaves and ranks. */
typedef struct side {
  const float *cells, *factor;
} side;

/* Numbers of the cells (step 1), or of one row that stands for every span (step 0). */
typedef struct plane {
  const float *first;
  size_t step;
} plane;

/* A product of one channel: out = own in + flood mean + diag(to) P to.factor from.factor' P' diag(from) in, with
 * N mean = weight' in. */
typedef struct product {
  const clt_transport *transport;
  int channel;
  bool transposed, without_near;
  side from, to;
  plane weight, flood;
  const double *in;
  size_t in_step;
  double *out;
  double *z, *chunks;            /* R + 1 sums over the leaves, and CLT_HIERARCHY_CHUNKS times as many */
  double *leaf_sums, *part_sums; /* CLT_LEAF_SUMS of each leaf and part */
  double *leaf_light;            /* f: CLT_LEAF_TERMS of each */
} product;

static const float EVEN[CLT_LEAF_SIDE_MAX] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
                                              1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
static const double EVEN_DRIVE[CLT_LEAF_SIDE_MAX] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
                                                     1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};

const clt_hierarchy_storage *clt_hierarchic_of(const clt_transport *transport) {
  return transport->kind == &clt_kind_hierarchy ? transport->storage : NULL;
}

double clt_transport_simplified(const clt_transport *transport) {
  const clt_hierarchy_storage *own = clt_hierarchic_of(transport);
  return own != NULL ? own->error : 0;
}

static side side_of(const clt_transport *transport, int channel, const float *cells, const float *factor) {
  const clt_hierarchy_storage *own = transport->storage;
  return (side){cells + (size_t)channel * transport->cols,
                factor + (size_t)channel * CLT_LEAF_TERMS * own->leaves * own->rank};
}

static void rows_of(const float *factor, size_t leaf, size_t rank, const float *row[CLT_PLAIN_ROWS]) {
  for (size_t term = 0; term < CLT_LEAF_TERMS; term++) {
    row[term] = factor + (CLT_LEAF_TERMS * leaf + term) * rank;
  }
}

size_t clt_hierarchic_scratch(const clt_hierarchy_storage *own) {
  const size_t parts = own->spans.first_part[CLT_SLICES];
  return (CLT_HIERARCHY_CHUNKS + 1) * (own->rank + 1) + CLT_LEAF_SUMS * (own->leaves + parts) +
         CLT_LEAF_TERMS * own->leaves;
}

/* T in, or T' in; in turn with other products of the channel until end_turn. */
static product begin_turn(const clt_transport *transport, int channel, bool transposed) {
  clt_hierarchy_storage *own = transport->storage;
  const side gather = side_of(transport, channel, own->gather, own->right);
  const side scale = side_of(transport, channel, own->scale, own->left);
  const plane flood = {own->flood + (size_t)channel * transport->cols, 1}, even = {EVEN, 0};
  pthread_mutex_lock(&own->turn[channel]);
  product of = {.transport = transport,
                .channel = channel,
                .transposed = transposed,
                .from = transposed ? scale : gather,
                .to = transposed ? gather : scale,
                .weight = transposed ? flood : even,
                .flood = transposed ? even : flood,
                .in_step = 1,
                .z = own->scratch + (size_t)channel * clt_hierarchic_scratch(own)};
  of.chunks = of.z + own->rank + 1;
  of.leaf_sums = of.chunks + CLT_HIERARCHY_CHUNKS * (own->rank + 1);
  of.part_sums = of.leaf_sums + CLT_LEAF_SUMS * own->leaves;
  of.leaf_light = of.part_sums + CLT_LEAF_SUMS * own->spans.first_part[CLT_SLICES];
  return of;
}

static void end_turn(const product *of) {
  clt_hierarchy_storage *own = of->transport->storage;
  pthread_mutex_unlock(&own->turn[of->channel]);
}

/* The sums of a slice's parts of leaves. */
static void sum_slice(const product *of, size_t slice) {
  const clt_hierarchy_storage *own = of->transport->storage;
  const clt_leaf_spans *spans = &own->spans;
  const clt_leaf_in in = {.place = spans->place,
                          .x = of->in,
                          .cells = of->from.cells,
                          .weight = of->weight.first,
                          .x_step = of->in_step,
                          .weight_step = of->weight.step};
  double *sums = of->part_sums + CLT_LEAF_SUMS * spans->first_part[slice];
  memset(sums, 0, CLT_LEAF_SUMS * (spans->first_part[slice + 1] - spans->first_part[slice]) * sizeof *sums);
  clt_leaf_choose()->sum(&in, spans->span + spans->first_span[slice],
                         spans->first_span[slice + 1] - spans->first_span[slice], sums);
}

static void fold_parts(const product *of) {
  const clt_hierarchy_storage *own = of->transport->storage;
  memset(of->leaf_sums, 0, CLT_LEAF_SUMS * own->leaves * sizeof *of->leaf_sums);
  for (size_t part = 0; part < own->spans.first_part[CLT_SLICES]; part++) {
    double *sums = of->leaf_sums + CLT_LEAF_SUMS * (size_t)own->spans.leaf[part];
    for (size_t term = 0; term < CLT_LEAF_SUMS; term++) {
      sums[term] += of->part_sums[CLT_LEAF_SUMS * part + term];
    }
  }
}

/* from.factor' m over a chunk of the leaves, and behind it weight' in. */
static void gather_chunk(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  const clt_plain_kernels *kernels = clt_plain_choose();
  const size_t end = own->leaves * (chunk + 1) / CLT_HIERARCHY_CHUNKS;
  double *sums = of->chunks + chunk * (own->rank + 1);
  memset(sums, 0, (own->rank + 1) * sizeof *sums);
  for (size_t leaf = own->leaves * chunk / CLT_HIERARCHY_CHUNKS; leaf < end; leaf++) {
    const double *m = of->leaf_sums + CLT_LEAF_SUMS * leaf;
    const float *row[CLT_PLAIN_ROWS];
    rows_of(of->from.factor, leaf, own->rank, row);
    kernels->add_float(row, m, own->rank, sums);
    sums[own->rank] += m[CLT_LEAF_TERMS];
  }
}

static void fold_chunks(const product *of) {
  const clt_hierarchy_storage *own = of->transport->storage;
  const size_t terms = own->rank + 1;
  memset(of->z, 0, terms * sizeof *of->z);
  for (size_t chunk = 0; chunk < CLT_HIERARCHY_CHUNKS; chunk++) {
    for (size_t k = 0; k < terms; k++) {
      of->z[k] += of->chunks[chunk * terms + k];
    }
  }
}

/* f = to.factor z of a chunk of the leaves. */
static void light_chunk(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  const clt_plain_kernels *kernels = clt_plain_choose();
  const size_t end = own->leaves * (chunk + 1) / CLT_HIERARCHY_CHUNKS;
  for (size_t leaf = own->leaves * chunk / CLT_HIERARCHY_CHUNKS; leaf < end; leaf++) {
    const float *row[CLT_PLAIN_ROWS];
    rows_of(of->to.factor, leaf, own->rank, row);
    kernels->dot_float(row, of->z, own->rank, of->leaf_light + CLT_LEAF_TERMS * leaf);
  }
}

/* The loops of a product. */
typedef struct loops {
  clt_turns sum, gather, light, spread, near[2];
} loops;

static loops begin_loops(void) {
  const clt_turns slices = clt_turns_of(CLT_SLICES), chunks = clt_turns_of(CLT_HIERARCHY_CHUNKS);
  loops all = {.sum = slices, .gather = chunks, .light = chunks, .spread = slices};
  clt_near_stream_turns(all.near);
  return all;
}

/* z and what the leaves give out, by every thread of a team. */
static void light_leaves(const product *of, loops *all) {
  size_t turn = 0;
  while (clt_turns_next(&all->sum, &turn)) {
    sum_slice(of, turn);
  }
#pragma omp barrier
#pragma omp single
  fold_parts(of);
  while (clt_turns_next(&all->gather, &turn)) {
    gather_chunk(of, turn);
  }
#pragma omp barrier
#pragma omp single
  fold_chunks(of);
  while (clt_turns_next(&all->light, &turn)) {
    light_chunk(of, turn);
  }
#pragma omp barrier
}

/* out over the cells of a slice. */
static void spread_slice(const product *of, size_t slice) {
  const clt_hierarchy_storage *own = of->transport->storage;
  const clt_leaf_spans *spans = &own->spans;
  const clt_leaf_out out = {.place = spans->place,
                            .x = of->in,
                            .own = own->own + (size_t)of->channel * of->transport->cols,
                            .flood = of->flood.first,
                            .cells = of->to.cells,
                            .x_step = of->in_step,
                            .flood_step = of->flood.step,
                            .mean = of->z[own->rank] / (double)of->transport->cols,
                            .leaf = spans->leaf + spans->first_part[slice],
                            .f = of->leaf_light,
                            .y = of->out};
  clt_leaf_choose()->spread(&out, spans->span + spans->first_span[slice],
                            spans->first_span[slice + 1] - spans->first_span[slice]);
}

static void multiply(const product *of) {
  const clt_near_stream *near = &((const clt_hierarchy_storage *)of->transport->storage)->near;
  loops all = begin_loops();
#pragma omp parallel if (of->transport->cols >= WORTH_SHARING)
  {
    size_t turn = 0;
    light_leaves(of, &all);
    while (clt_turns_next(&all.spread, &turn)) {
      spread_slice(of, turn);
      if (!of->transposed && !of->without_near) {
        clt_near_stream_add(near, of->channel, turn, of->in, of->out);
      }
    }
    if (of->transposed) {
#pragma omp barrier
      clt_near_stream_add_transposed(near, of->channel, all.near, of->in, of->out);
    }
  }
}

static void hierarchy_apply(const clt_transport *transport, int channel, const double *x, double *y) {
  product of = begin_turn(transport, channel, false);
  of.in = x;
  of.out = y;
  multiply(&of);
  end_turn(&of);
}

static void hierarchy_apply_transposed(const clt_transport *transport, int channel, const double *y, double *x) {
  product of = begin_turn(transport, channel, true);
  of.in = y;
  of.out = x;
  multiply(&of);
  end_turn(&of);
}

/* core = left right' of one leaf with itself. */
static void leaf_core(const clt_hierarchy_storage *own, side to, side from, size_t leaf,
                      double core[CLT_LEAF_TERMS][CLT_LEAF_TERMS]) {
  for (size_t s = 0; s < CLT_LEAF_TERMS; s++) {
    for (size_t t = 0; t < CLT_LEAF_TERMS; t++) {
      core[s][t] = 0;
      for (size_t r = 0; r < own->rank; r++) {
        core[s][t] += (double)to.factor[(CLT_LEAF_TERMS * leaf + s) * own->rank + r] *
                      (double)from.factor[(CLT_LEAF_TERMS * leaf + t) * own->rank + r];
      }
    }
  }
}

static void hierarchy_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  const clt_hierarchy_storage *own = transport->storage;
  const side to = side_of(transport, channel, own->scale, own->left);
  const side from = side_of(transport, channel, own->gather, own->right);
  const size_t at = (size_t)channel * transport->cols;
  for (size_t leaf = 0; leaf < own->leaves; leaf++) {
    const clt_leaf box = own->leaf[leaf];
    double core[CLT_LEAF_TERMS][CLT_LEAF_TERMS];
    leaf_core(own, to, from, leaf, core);
    for (int32_t k = 0; k < box.width * box.height; k++) {
      const double u = clt_leaf_place(k % box.width, box.width), v = clt_leaf_place(k / box.width, box.height);
      const double term[CLT_LEAF_TERMS] = {1, u, v, u * v};
      const size_t i = (size_t)(box.y + k / box.width) * (size_t)transport->width + (size_t)(box.x + k % box.width);
      double sum = 0;
      for (int t = 0; t < CLT_LEAF_TERMS * CLT_LEAF_TERMS; t++) {
        sum += term[t / CLT_LEAF_TERMS] * core[t / CLT_LEAF_TERMS][t % CLT_LEAF_TERMS] * term[t % CLT_LEAF_TERMS];
      }
      diagonal[i] = (double)own->own[at + i] + (double)own->flood[at + i] / (double)transport->cols +
                    (double)to.cells[i] * sum * (double)from.cells[i];
    }
  }
}

/* T 1, near light by its rows. */
static void hierarchy_row_sums(const clt_transport *transport, int channel, double *sums) {
  const clt_hierarchy_storage *own = transport->storage;
  const float *value = own->value + (size_t)channel * (size_t)own->start[transport->cols];
  product of = begin_turn(transport, channel, false);
  of.without_near = true;
  of.in = EVEN_DRIVE;
  of.in_step = 0;
  of.out = sums;
  multiply(&of);
  end_turn(&of);
#pragma omp parallel for schedule(static) if (transport->cols >= WORTH_SHARING)
  for (size_t i = 0; i < transport->cols; i++) {
    for (int64_t e = own->start[i]; e < own->start[i + 1]; e++) {
      sums[i] += (double)value[e];
    }
  }
}

/* Spans are read twice. */
static size_t hierarchy_bytes(const clt_transport *transport) {
  const clt_hierarchy_storage *own = transport->storage;
  const size_t factors = 2 * CLT_LEAF_TERMS * own->leaves * own->rank;
  const size_t spans = 2 * own->spans.first_span[CLT_SLICES] * sizeof *own->spans.span;
  return (size_t)transport->channels *
         (clt_near_stream_bytes(&own->near) + spans + (factors + 4 * transport->cols) * sizeof(float));
}

static float *hierarchy_entries(const clt_transport *transport, int channel) {
  (void)transport;
  (void)channel;
  return NULL;
}

const clt_kind clt_kind_hierarchy = {.name = "hierarchy",
                                     .apply = hierarchy_apply,
                                     .apply_transposed = hierarchy_apply_transposed,
                                     .diagonal = hierarchy_diagonal,
                                     .row_sums = hierarchy_row_sums,
                                     .bytes = hierarchy_bytes,
                                     .entries = hierarchy_entries,
                                     .check = clt_hierarchic_check,
                                     .load = clt_hierarchic_load,
                                     .save = clt_hierarchic_save,
                                     .destroy = clt_hierarchic_destroy};
