/* Products with hierarchy storage. */
#include "transport/hierarchy.h"

#include <string.h>

#include "base/turns.h"
#include "transport/kernels.h"

enum { WORTH_SHARING = 16384 }; /* cells from which threads pay */

/* One side of the far light: what cells are multiplied by, and the factor between leaves and ranks. */
typedef struct side {
  const float *cells;
  const clt_leaf_rows *factor;
} side;

/* Numbers of the cells (step 1), or of one row that stands for every span (step 0). */
typedef struct plane {
  const float *first;
  size_t step;
} plane;

/* A product of one channel: out = own in + flood mean + diag(to) P to.factor core from.factor' P' diag(from) in, with
 * N mean = weight' in. Sums are double; of codes, and through a core, those between leaves and ranks are float. */
typedef struct product {
  const clt_transport *transport;
  int channel;
  bool transposed, without_near;
  side from, to;
  plane weight, flood;
  const double *in;
  size_t in_step;
  double *out;
  double *weighed;               /* weight' in, of all leaves and of each chunk of them */
  double *leaf_sums, *part_sums; /* CLT_LEAF_SUMS of each leaf and part */
  double *leaf_light;            /* f: CLT_LEAF_TERMS of each */
  double *z, *given, *chunks;    /* from.factor' m, the same with the core, and the first by chunks of the leaves */
  float *narrow;                 /* given; and the chunks, where their sums are float */
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

static side side_of(const clt_transport *transport, int channel, const float *cells, const clt_leaf_rows *factor) {
  return (side){cells + (size_t)channel * transport->cols, factor};
}

void clt_hierarchic_core(const clt_hierarchy_storage *own, int channel, bool transposed, const float *in, float *out) {
  enum { ROWS = CLT_PLAIN_ROWS };
  const size_t rank = own->rank;
  if (own->core == NULL) {
    memcpy(out, in, rank * sizeof *out);
    return;
  }
  const float *core = own->core + (size_t)channel * rank * rank;
  memset(out, 0, rank * sizeof *out);
  for (size_t first = 0; first < rank; first += ROWS) {
    const float *row[ROWS];
    float part[ROWS] = {0};
    const size_t rows = rank - first < ROWS ? rank - first : ROWS;
    for (size_t k = 0; k < ROWS; k++) {
      row[k] = core + (first + (k < rows ? k : 0)) * rank;
      part[k] = k < rows ? in[first + k] : 0;
    }
    if (transposed) {
      own->left.floats->add(row, part, rank, out);
    } else {
      own->left.floats->dot(row, in, rank, part);
      memcpy(out + first, part, rows * sizeof *out);
    }
  }
}

size_t clt_hierarchic_scratch(const clt_hierarchy_storage *own) {
  const size_t parts = own->spans.first_part[CLT_SLICES], ranks = (CLT_HIERARCHY_CHUNKS + 2) * own->rank;
  return ranks + (ranks + 1) / 2 + CLT_HIERARCHY_CHUNKS + 1 + CLT_LEAF_SUMS * (own->leaves + parts) +
         CLT_LEAF_TERMS * own->leaves;
}

/* T in, or T' in; in turn with other products of the channel until end_turn. */
static product begin_turn(const clt_transport *transport, int channel, bool transposed) {
  clt_hierarchy_storage *own = transport->storage;
  const side gather = side_of(transport, channel, own->gather, &own->right);
  const side scale = side_of(transport, channel, own->scale, &own->left);
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
                .weighed = own->scratch + (size_t)channel * clt_hierarchic_scratch(own)};
  of.leaf_sums = of.weighed + 1 + CLT_HIERARCHY_CHUNKS;
  of.part_sums = of.leaf_sums + CLT_LEAF_SUMS * own->leaves;
  of.leaf_light = of.part_sums + CLT_LEAF_SUMS * own->spans.first_part[CLT_SLICES];
  of.z = of.leaf_light + CLT_LEAF_TERMS * own->leaves;
  of.given = of.z + own->rank;
  of.chunks = of.given + own->rank;
  of.narrow = (float *)(of.chunks + CLT_HIERARCHY_CHUNKS * own->rank);
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

static size_t chunk_first(const clt_hierarchy_storage *own, size_t chunk) {
  return own->leaves * chunk / CLT_HIERARCHY_CHUNKS;
}

static float *narrow_chunk(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  return of->narrow + (chunk + 1) * own->rank;
}

/* from.factor' m over a chunk of the leaves. */
static void gather_plain(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  double *sums = of->chunks + chunk * own->rank;
  memset(sums, 0, own->rank * sizeof *sums);
  for (size_t leaf = chunk_first(own, chunk); leaf < chunk_first(own, chunk + 1); leaf++) {
    clt_leaf_rows_add_wide(of->from.factor, of->channel, leaf, of->leaf_sums + CLT_LEAF_SUMS * leaf, sums);
  }
}

static void gather_codes(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  float *sums = narrow_chunk(of, chunk);
  memset(sums, 0, own->rank * sizeof *sums);
  for (size_t leaf = chunk_first(own, chunk); leaf < chunk_first(own, chunk + 1); leaf++) {
    const double *m = of->leaf_sums + CLT_LEAF_SUMS * leaf;
    const float term[CLT_LEAF_TERMS] = {(float)m[0], (float)m[1], (float)m[2], (float)m[3]};
    clt_leaf_rows_add(of->from.factor, of->channel, leaf, term, own->rank, sums);
  }
  for (size_t k = 0; k < own->rank; k++) {
    of->chunks[chunk * own->rank + k] = (double)sums[k];
  }
}

/* The same, and weight' in. */
static void gather_chunk(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  double weighed = 0;
  if (of->from.factor->bits == 32) {
    gather_plain(of, chunk);
  } else {
    gather_codes(of, chunk);
  }
  for (size_t leaf = chunk_first(own, chunk); leaf < chunk_first(own, chunk + 1); leaf++) {
    weighed += of->leaf_sums[CLT_LEAF_SUMS * leaf + CLT_LEAF_TERMS];
  }
  of->weighed[1 + chunk] = weighed;
}

/* given = core z, or core' z. */
static void pass_core(const product *of) {
  const clt_hierarchy_storage *own = of->transport->storage;
  float *in = narrow_chunk(of, 0), *out = of->narrow;
  for (size_t k = 0; k < own->rank; k++) {
    in[k] = (float)of->z[k];
  }
  clt_hierarchic_core(own, of->channel, of->transposed, in, out);
  for (size_t k = 0; k < own->rank; k++) {
    of->given[k] = own->core != NULL ? (double)out[k] : of->z[k];
  }
}

static void fold_chunks(const product *of) {
  const clt_hierarchy_storage *own = of->transport->storage;
  memset(of->z, 0, own->rank * sizeof *of->z);
  of->weighed[0] = 0;
  for (size_t chunk = 0; chunk < CLT_HIERARCHY_CHUNKS; chunk++) {
    for (size_t k = 0; k < own->rank; k++) {
      of->z[k] += of->chunks[chunk * own->rank + k];
    }
    of->weighed[0] += of->weighed[1 + chunk];
  }
  pass_core(of);
}

/* f = to.factor core z of a chunk of the leaves. */
static void light_chunk(const product *of, size_t chunk) {
  const clt_hierarchy_storage *own = of->transport->storage;
  for (size_t leaf = chunk_first(own, chunk); leaf < chunk_first(own, chunk + 1); leaf++) {
    double *f = of->leaf_light + CLT_LEAF_TERMS * leaf;
    float term[CLT_LEAF_TERMS];
    if (of->to.factor->bits == 32) {
      clt_leaf_rows_dot_wide(of->to.factor, of->channel, leaf, of->given, f);
      continue;
    }
    clt_leaf_rows_dot(of->to.factor, of->channel, leaf, of->narrow, own->rank, term);
    for (size_t t = 0; t < CLT_LEAF_TERMS; t++) {
      f[t] = (double)term[t];
    }
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
                            .mean = of->weighed[0] / (double)of->transport->cols,
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

/* pair = left core right' of one leaf with itself; room holds 12 R. */
static void pair_of(const clt_hierarchy_storage *own, int channel, size_t leaf, float *room,
                    double pair[CLT_LEAF_TERMS][CLT_LEAF_TERMS]) {
  const size_t rank = own->rank;
  float *left = room, *to = room + CLT_LEAF_TERMS * rank, *from = to + CLT_LEAF_TERMS * rank;
  clt_leaf_rows_read(&own->left, channel, leaf, left);
  clt_leaf_rows_read(&own->right, channel, leaf, from);
  for (size_t s = 0; s < CLT_LEAF_TERMS; s++) {
    clt_hierarchic_core(own, channel, true, left + s * rank, to + s * rank);
    for (size_t t = 0; t < CLT_LEAF_TERMS; t++) {
      pair[s][t] = 0;
      for (size_t r = 0; r < rank; r++) {
        pair[s][t] += (double)to[s * rank + r] * (double)from[t * rank + r];
      }
    }
  }
}

/* The far light of a leaf's cells to themselves, and the rest of the diagonal. */
static void leaf_diagonal(const product *of, size_t leaf, double *diagonal) {
  const clt_hierarchy_storage *own = of->transport->storage;
  const size_t cells = of->transport->cols, at = (size_t)of->channel * cells;
  const clt_leaf box = own->leaf[leaf];
  double pair[CLT_LEAF_TERMS][CLT_LEAF_TERMS];
  pair_of(own, of->channel, leaf, of->narrow, pair);
  for (int32_t k = 0; k < box.width * box.height; k++) {
    const double u = clt_leaf_place(k % box.width, box.width), v = clt_leaf_place(k / box.width, box.height);
    const double term[CLT_LEAF_TERMS] = {1, u, v, u * v};
    const size_t i = (size_t)(box.y + k / box.width) * (size_t)of->transport->width + (size_t)(box.x + k % box.width);
    double sum = 0;
    for (int t = 0; t < CLT_LEAF_TERMS * CLT_LEAF_TERMS; t++) {
      sum += term[t / CLT_LEAF_TERMS] * pair[t / CLT_LEAF_TERMS][t % CLT_LEAF_TERMS] * term[t % CLT_LEAF_TERMS];
    }
    diagonal[i] = (double)own->own[at + i] + (double)own->flood[at + i] / (double)cells +
                  (double)of->to.cells[i] * sum * (double)of->from.cells[i];
  }
}

static void hierarchy_diagonal(const clt_transport *transport, int channel, double *diagonal) {
  const product of = begin_turn(transport, channel, false);
  for (size_t leaf = 0; leaf < ((const clt_hierarchy_storage *)transport->storage)->leaves; leaf++) {
    leaf_diagonal(&of, leaf, diagonal);
  }
  end_turn(&of);
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

/* Spans are read twice, and what channels share once for each of them. */
static size_t hierarchy_bytes(const clt_transport *transport) {
  const clt_hierarchy_storage *own = transport->storage;
  const size_t channels = (size_t)transport->channels;
  const size_t spans = 2 * own->spans.first_span[CLT_SLICES] * sizeof *own->spans.span;
  const size_t cores = own->core != NULL ? own->rank * own->rank * sizeof *own->core : 0;
  return channels * (clt_near_stream_bytes(&own->near) + spans + cores + 4 * transport->cols * sizeof(float)) +
         channels / own->left.sets * (clt_leaf_rows_bytes(&own->left) + clt_leaf_rows_bytes(&own->right));
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
