/* From blocks storage to a hierarchy. */
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/blocks.h"
#include "transport/hierarchy_make.h"
#include "transport/hierarchy_tree.h"

typedef struct build {
  const clt_transport *from;
  const clt_block_storage *blocks;
  clt_transport *to;
  clt_hierarchy_storage *own;
  clt_planes planes; /* the columns, channel by channel */
} build;

/* The diagonal apart, the rest of the near entries by rows. */
static void take_near(build *job) {
  const clt_block_storage *blocks = job->blocks;
  clt_hierarchy_storage *own = job->own;
  const size_t cells = job->from->cols, before = (size_t)blocks->start[cells];
  size_t kept = 0;
  for (size_t i = 0; i < cells; i++) {
    for (int64_t e = blocks->start[i]; e < blocks->start[i + 1]; e++) {
      if (blocks->cell[e] != (int32_t)i) {
        own->cell[kept++] = blocks->cell[e];
      }
    }
    own->start[i + 1] = (int64_t)kept;
  }
  for (size_t c = 0; c < (size_t)job->from->channels; c++) {
    size_t next = c * kept;
    for (size_t i = 0; i < cells; i++) {
      for (int64_t e = blocks->start[i]; e < blocks->start[i + 1]; e++) {
        const float value = blocks->value[c * before + (size_t)e];
        if (blocks->cell[e] == (int32_t)i) {
          own->own[c * cells + i] += value;
        } else {
          own->value[next++] = value;
        }
      }
    }
  }
}

static size_t near_entries(const build *job) {
  const clt_block_storage *blocks = job->blocks;
  size_t count = 0;
  for (size_t i = 0; i < job->from->cols; i++) {
    for (int64_t e = blocks->start[i]; e < blocks->start[i + 1]; e++) {
      count += blocks->cell[e] != (int32_t)i;
    }
  }
  return count;
}

/* The sum of w (P fit) over a leaf: P fit is bilinear, so that it is summed row by row. */
static double weigh(const build *job, const clt_leaf *leaf, const double fit[CLT_LEAF_TERMS]) {
  double sum = 0;
  for (int32_t row = 0; row < leaf->height; row++) {
    const float *flux = job->blocks->flux + (size_t)(leaf->y + row) * (size_t)job->from->width + (size_t)leaf->x;
    const double v = clt_leaf_place(row, leaf->height);
    for (int32_t k = 0; k < leaf->width; k++) {
      sum += (double)flux[k] * (fit[0] + v * fit[2] + (fit[1] + v * fit[3]) * clt_leaf_place(k, leaf->width));
    }
  }
  return sum;
}

static int32_t block_of(const build *job, const clt_leaf *leaf) {
  return job->blocks->block[(size_t)leaf->y * (size_t)job->from->width + (size_t)leaf->x];
}

/* The factors of one column: how block b lights every leaf, and by reciprocity every leaf block b, where light is
 * counted from its mean over the block that it comes from. fit (4L) and mean (K) are room. */
static void factor_column(build *job, size_t channel, size_t b, double *fit, double *mean) {
  const clt_block_storage *blocks = job->blocks;
  clt_hierarchy_storage *own = job->own;
  const size_t count = blocks->count;
  memset(mean, 0, count * sizeof *mean);
  for (size_t k = 0; k < own->leaves; k++) {
    const int32_t at = block_of(job, &own->leaf[k]);
    clt_leaf_fit(&job->planes, channel * count + b, &own->leaf[k], fit + CLT_LEAF_TERMS * k);
    mean[at] += blocks->inverse[at] * weigh(job, &own->leaf[k], fit + CLT_LEAF_TERMS * k);
  }
  for (size_t m = 0; m < CLT_LEAF_TERMS * own->leaves; m++) {
    const int32_t at = block_of(job, &own->leaf[m / CLT_LEAF_TERMS]);
    const bool even = m % CLT_LEAF_TERMS == 0;
    float *left = own->left.value + (channel * CLT_LEAF_TERMS * own->leaves + m) * own->rank;
    float *right = own->right.value + (channel * CLT_LEAF_TERMS * own->leaves + m) * own->rank;
    left[b] = (float)fit[m];
    right[count + b] = (float)(blocks->inverse[b] * (fit[m] - (even ? mean[at] : 0)));
    if (even && at == (int32_t)b) {
      left[count + b] = 1;
      right[b] = (float)blocks->inverse[b];
    }
  }
}

static clt_status factor_columns(build *job, clt_error *error) {
  const size_t nodes = CLT_LEAF_TERMS * job->own->leaves, count = job->blocks->count;
  const size_t columns = (size_t)job->from->channels * count;
  clt_status status = CLT_OK;
#pragma omp parallel
  {
    double *fit = clt_alloc(nodes + count, sizeof *fit);
#pragma omp for schedule(static)
    for (size_t k = 0; k < columns; k++) {
      if (fit != NULL) {
        factor_column(job, k / count, k % count, fit, fit + nodes);
      } else {
#pragma omp critical
        status = clt_fail(error, CLT_FAILED, "no memory for the far light of %zu leaves", nodes / CLT_LEAF_TERMS);
      }
    }
    free(fit);
  }
  return status;
}

/* Own light, near entries and what cells take up and give; every cell reflects alike within its leaf. */
static void fill_cells(build *job) {
  const size_t cells = job->from->cols;
  for (size_t at = 0; at < (size_t)job->from->channels * cells; at++) {
    job->own->scale[at] = 1;
    job->own->gather[at] = job->blocks->flux[at % cells];
  }
  take_near(job);
}

static clt_status size_planes(build *job, clt_error *error) {
  const size_t cells = job->from->cols, count = job->blocks->count;
  double *size = clt_alloc(job->planes.count, sizeof *size), *room = clt_alloc(cells, sizeof *room);
  job->planes.size = size;
  for (size_t c = 0; size != NULL && room != NULL && c < (size_t)job->from->channels; c++) {
    const double own = clt_own_light(job->from, (int)c, room);
    for (size_t b = 0; b < count; b++) {
      size[c * count + b] = own;
    }
  }
  free(room);
  return size != NULL && room != NULL ? CLT_OK
                                      : clt_fail(error, CLT_FAILED, "no memory for the columns of %zu blocks", count);
}

static clt_status build_hierarchy(build *job, double tolerance, clt_error *error) {
  const clt_transport *from = job->from;
  const clt_block_storage *blocks = job->blocks;
  clt_leaf *leaf = NULL;
  size_t leaves = 0;
  job->planes = (clt_planes){.width = from->width,
                             .height = from->height,
                             .count = (size_t)from->channels * blocks->count,
                             .values = blocks->column,
                             .label = blocks->block,
                             .tolerance = tolerance};
  clt_status status = size_planes(job, error);
  if (status == CLT_OK) {
    status = clt_leaves_grow(&job->planes, &leaf, &leaves, error);
  }
  if (status == CLT_OK) {
    status = clt_hierarchic_begin(job->to, leaves, 2 * blocks->count, "a hierarchy", error);
  }
  if (status != CLT_OK) {
    free(leaf);
    return status;
  }
  job->own = job->to->storage;
  job->own->leaf = leaf;
  const size_t entries = near_entries(job);
  status = clt_hierarchic_reserve_cells(job->to, error);
  if (status == CLT_OK) {
    status = clt_hierarchic_reserve_near(job->to, entries, error);
  }
  if (status == CLT_OK) {
    fill_cells(job);
    status = factor_columns(job, error);
  }
  if (status == CLT_OK) {
    double left_out[CLT_CHANNELS_MAX];
    for (size_t c = 0; c < (size_t)from->channels; c++) {
      left_out[c] = tolerance * job->planes.size[c * blocks->count];
    }
    status = clt_leaves_compress(job->own, (size_t)from->channels, left_out, error);
  }
  return status == CLT_OK ? clt_hierarchic_finish(job->to, entries, "a hierarchy", error) : status;
}

clt_status clt_hierarchy_from_blocks(const clt_transport *from, double tolerance, clt_transport *to, clt_error *error) {
  build job = {.from = from, .blocks = from->storage, .to = to};
  clt_status status = build_hierarchy(&job, tolerance, error);
  free((void *)job.planes.size);
  return status;
}
