/* Hierarchical non-conflicting acquisition after Sen et al. 2005 (NUMERICS section 6), with two changes.
 *
 * Blocks are split where their light cannot be *predicted*, not wherever there is light: a block that turned out to be
 * lit evenly when its parent was split stays whole, however bright. Two blocks conflict when some observed cell sees
 * both with an unpredicted part (its spread) above tau; blocks of one colour are split in one go.
 *
 * The last child of a block needs no photograph: it is what the others leave of the parent, because the parents of a
 * class were themselves measured. What each photograph shows beyond the prediction goes to the lit children by their
 * variance, so that every level adds up to the one above, and the top to the flood. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "acquire/colouring.h"
#include "acquire/row_trees.h"
#include "acquire/session.h"
#include "base/memory.h"
#include "base/order.h"

/* Rows split their own tree down to this part of tau: blocks that are lit anyway tell them something for nothing. */
#define ROW_SHARE 0.25
/* Cells whose flood is below this part of the brightest do not count for the scale of a channel. */
#define LIT_SHARE 0.1
enum { DENSE_CELLS_MAX = 4096, PHASE_MAX = 40 };

typedef struct hierarchy {
  clt_session *session;
  clt_pyramid pyramid;
  double scale[CLT_CHANNELS_MAX]; /* light of one lit cell fully flooded, per channel: the unit of the row trees */
  double threshold;               /* tau, in that unit, or the noise where that is more */
  clt_row_trees trees;
  int32_t *colour; /* of each block of the level, -1: not lit */
  int32_t colours;
  double *fill;          /* of the pattern, per node */
  float *noise;          /* variance of the last observation per row, in squared units */
  float *flood_variance; /* likewise */
  char phase[PHASE_MAX];
} hierarchy;

/* The median flood of the lit cells of each channel; a channel without light takes the brightest channel's. */
static clt_status find_scale(hierarchy *tree, clt_error *error) {
  size_t cells = tree->session->cells;
  int channels = tree->session->info.channels;
  float *sorted = clt_alloc(cells, sizeof *sorted);
  if (sorted == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for %zu cells", cells);
  }
  double largest = 0;
  for (int c = 0; c < channels; c++) {
    memcpy(sorted, tree->session->flood.data + (size_t)c * cells, cells * sizeof *sorted);
    clt_sort_floats(sorted, cells);
    size_t dark = 0;
    while (dark < cells && sorted[dark] < LIT_SHARE * sorted[cells - 1]) {
      dark++;
    }
    tree->scale[c] = dark < cells ? sorted[dark + (cells - dark) / 2] : 0;
    largest = fmax(largest, tree->scale[c]);
  }
  free(sorted);
  if (!(largest > 0)) {
    return clt_fail(error, CLT_FAILED,
                    "the camera sees no light of a fully driven grid; check the projector, the lens cap and the "
                    "exposures");
  }
  for (int c = 0; c < channels; c++) {
    tree->scale[c] = tree->scale[c] > 1e-3 * largest ? tree->scale[c] : largest;
  }
  return CLT_OK;
}

/* The largest of the channels' variances plus the black's, in squared units. */
static void scale_variance(const hierarchy *tree, const clt_image *variance, float *scaled) {
  size_t cells = tree->session->cells;
  for (size_t i = 0; i < cells; i++) {
    double largest = 0;
    for (int c = 0; c < variance->channels; c++) {
      largest = fmax(largest, variance->data[(size_t)c * cells + i] / (tree->scale[c] * tree->scale[c]));
    }
    scaled[i] = (float)largest;
  }
}

/* Turns the last observation into light without black and its variance. */
static void subtract_black(hierarchy *tree) {
  clt_session *session = tree->session;
  size_t values = clt_image_size(&session->seen);
  for (size_t at = 0; at < values; at++) {
    session->seen.data[at] -= session->black.data[at];
    session->deviation.data[at] =
        session->deviation.data[at] * session->deviation.data[at] + session->black_variance.data[at];
  }
  scale_variance(tree, &session->deviation, tree->noise);
}

/* A split tells a row nothing where what it may find is below the noise of a photograph: the rms of the last one's,
 * over the rows that were seen, is the least threshold of the next level. */
static void respect_noise(hierarchy *tree) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < tree->session->cells; i++) {
    if (isfinite(tree->noise[i])) {
      sum += (double)tree->noise[i];
      count += 1;
    }
  }
  tree->threshold = fmax(tree->session->options.threshold, count > 0 ? sqrt(sum / count) : 0);
}

static void light_block(const hierarchy *tree, int level, int32_t node) {
  clt_image *drive = &tree->session->drive;
  clt_block block = clt_block_of(&tree->pyramid, level, node);
  for (int y = block.y; y < block.y + block.height; y++) {
    for (int x = block.x; x < block.x + block.width; x++) {
      tree->fill[y * drive->width + x] = 1;
      for (int c = 0; c < drive->channels; c++) {
        drive->data[((size_t)c * (size_t)drive->height + (size_t)y) * (size_t)drive->width + (size_t)x] = 1;
      }
    }
  }
}

/* Lights the child of ordinal q of every block of one colour, but no block's last child; false where there is none. */
static bool light_class(const hierarchy *tree, int level, int32_t colour, int q) {
  const clt_pyramid *pyramid = &tree->pyramid;
  int32_t first = pyramid->first[level];
  bool any = false;
  clt_session_fill(tree->session, 0);
  memset(tree->fill, 0, (size_t)pyramid->first[1] * sizeof *tree->fill);
  for (int32_t node = first; node < pyramid->first[level + 1]; node++) {
    int32_t children[4];
    if (tree->colour[node - first] == colour && q < clt_block_children(pyramid, level, node, children) - 1) {
      light_block(tree, level - 1, children[q]);
      any = true;
    }
  }
  clt_block_fill(pyramid, tree->fill);
  return any;
}

static clt_status photograph_class(hierarchy *tree, clt_row_trees *split, int level, int32_t colour, clt_error *error) {
  for (int q = 0; q < 3; q++) {
    if (!light_class(tree, level, colour, q)) {
      continue;
    }
    clt_status status = clt_session_observe(tree->session, tree->phase, error);
    if (status != CLT_OK) {
      return status;
    }
    subtract_black(tree);
    clt_row_trees_correct(split, &tree->pyramid, level - 1, tree->fill, &tree->session->seen, tree->scale, tree->noise);
  }
  return CLT_OK;
}

static clt_status colour_level(hierarchy *tree, int level, clt_error *error) {
  const clt_row_trees *trees = &tree->trees;
  int32_t blocks = tree->pyramid.first[level + 1] - tree->pyramid.first[level];
  int64_t *start = clt_alloc(trees->rows + 1, sizeof *start);
  int32_t *column = clt_alloc((size_t)trees->start[trees->rows], sizeof *column);
  clt_status status = CLT_OK;
  if (start == NULL || column == NULL) {
    status = clt_fail(error, CLT_FAILED, "out of memory for the conflicts of %d blocks", blocks);
  } else {
    clt_row_trees_active(trees, &tree->pyramid, level, tree->threshold, start, column);
    status = clt_colour_columns(trees->rows, start, column, blocks, tree->colour, &tree->colours, error);
  }
  free(start);
  free(column);
  return status;
}

/* Splits the blocks of a level. */
static clt_status refine_level(hierarchy *tree, int level, clt_error *error) {
  clt_progress *progress = &tree->session->progress;
  int top = tree->pyramid.levels - 1;
  snprintf(tree->phase, sizeof tree->phase, "level %d of %d", top - level + 1, top);
  clt_status status = colour_level(tree, level, error);
  if (status != CLT_OK) {
    return status;
  }
  /* The levels below are expected to need as many classes as this one. */
  progress->total = progress->done + 3L * tree->colours * level + tree->session->options.checks;
  clt_row_trees split = {0};
  status = clt_row_trees_split(&tree->trees, &tree->pyramid, level, ROW_SHARE * tree->threshold, tree->colour, &split,
                               error);
  for (int32_t colour = 0; status == CLT_OK && colour < tree->colours; colour++) {
    status = photograph_class(tree, &split, level, colour, error);
  }
  if (status != CLT_OK) {
    clt_row_trees_finish(&split);
    return status;
  }
  respect_noise(tree);
  clt_row_trees_settle(&split, &tree->trees, &tree->pyramid, level);
  clt_row_trees_finish(&tree->trees);
  tree->trees = split;
  return CLT_OK;
}

static void write_dense(const hierarchy *tree, clt_transport *transport) {
  const clt_row_trees *trees = &tree->trees;
  size_t cells = tree->session->cells;
  for (int c = 0; c < trees->channels; c++) {
    float *entries = clt_transport_entries(transport, c);
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < trees->rows; i++) {
      for (int64_t e = trees->start[i]; e < trees->start[i + 1]; e++) {
        clt_block block =
            clt_block_of(&tree->pyramid, clt_pyramid_level(&tree->pyramid, trees->node[e]), trees->node[e]);
        float entry = (float)(tree->scale[c] * trees->value[e * trees->channels + c] / (block.width * block.height));
        for (int k = 0; k < block.width * block.height; k++) {
          int x = block.x + k % block.width, y = block.y + k / block.width;
          entries[i * cells + (size_t)y * (size_t)tree->pyramid.width[0] + (size_t)x] = entry;
        }
      }
    }
  }
}

static clt_status make_dense(const hierarchy *tree, clt_transport **out, clt_error *error) {
  const clt_rig_info *info = &tree->session->info;
  clt_status status =
      clt_transport_create_dense(info->width, info->height, info->channels, tree->session->cells, out, error);
  if (status == CLT_OK) {
    write_dense(tree, *out);
  }
  return status;
}

static clt_status make_tree(const hierarchy *tree, clt_transport **out, clt_error *error) {
  const clt_row_trees *trees = &tree->trees;
  const clt_rig_info *info = &tree->session->info;
  int64_t leaves = trees->start[trees->rows];
  float *entries = clt_alloc((size_t)leaves * (size_t)trees->channels, sizeof *entries);
  if (entries == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a transport of %lld entries", (long long)leaves);
  }
#pragma omp parallel for schedule(static)
  for (int64_t e = 0; e < leaves; e++) {
    int level = clt_pyramid_level(&tree->pyramid, trees->node[e]);
    int cells = clt_block_cells(&tree->pyramid, level, trees->node[e]);
    for (int c = 0; c < trees->channels; c++) {
      entries[c * leaves + e] = (float)(tree->scale[c] * trees->value[e * trees->channels + c] / cells);
    }
  }
  clt_status status = clt_transport_create_tree(info->width, info->height, info->channels, trees->rows, trees->start,
                                                trees->node, entries, out, error);
  free(entries);
  return status;
}

/* Errors of whole blocks as the deviation of one entry that gives an appearance the same error: the errors of a row's
 * leaves add up to sum variance * mean(x^2), those of N single entries to N sigma^2 mean(x^2). Infinite where the flood
 * was not seen. */
static clt_status write_sigma(const hierarchy *tree, clt_transport *transport, clt_error *error) {
  const clt_row_trees *trees = &tree->trees;
  clt_status status = clt_transport_keep_sigma(transport, error);
  for (int c = 0; status == CLT_OK && c < trees->channels; c++) {
    float *sigma = clt_transport_sigma_values(transport, c);
    for (size_t i = 0; i < trees->rows; i++) {
      double sum = isfinite(tree->flood_variance[i]) ? 0 : INFINITY;
      for (int64_t e = trees->start[i]; e < trees->start[i + 1]; e++) {
        sum += trees->variance[e];
      }
      sigma[i] = (float)(tree->scale[c] * sqrt(sum / (double)tree->session->cells));
    }
  }
  return status;
}

static void finish_hierarchy(hierarchy *tree) {
  clt_row_trees_finish(&tree->trees);
  free(tree->colour);
  free(tree->fill);
  free(tree->noise);
  free(tree->flood_variance);
}

static clt_status init_hierarchy(hierarchy *tree, clt_session *session, clt_error *error) {
  size_t cells = session->cells;
  *tree = (hierarchy){.session = session,
                      .pyramid = clt_pyramid_of(session->info.width, session->info.height),
                      .threshold = session->options.threshold,
                      .colour = clt_alloc(cells, sizeof *tree->colour),
                      .noise = clt_alloc(cells, sizeof *tree->noise),
                      .flood_variance = clt_alloc(cells, sizeof *tree->flood_variance)};
  tree->fill = clt_alloc((size_t)tree->pyramid.first[tree->pyramid.levels], sizeof *tree->fill);
  if (tree->colour == NULL || tree->fill == NULL || tree->noise == NULL || tree->flood_variance == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a pyramid over %zu cells", cells);
  }
  clt_status status = find_scale(tree, error);
  if (status != CLT_OK) {
    return status;
  }
  scale_variance(tree, &session->flood_variance, tree->flood_variance);
  return clt_row_trees_plant(&tree->pyramid, &session->flood, tree->scale, tree->flood_variance, &tree->trees, error);
}

static clt_status measure_hierarchical(clt_session *session, clt_transport **out, clt_error *error) {
  hierarchy tree;
  clt_transport *transport = NULL;
  clt_status status = init_hierarchy(&tree, session, error);
  for (int level = tree.pyramid.levels - 1; status == CLT_OK && level > 0; level--) {
    status = refine_level(&tree, level, error);
  }
  if (status == CLT_OK) {
    clt_row_trees_match_flood(&tree.trees, &session->flood, tree.scale, tree.flood_variance);
    bool dense = session->cells <= DENSE_CELLS_MAX;
    status = dense ? make_dense(&tree, &transport, error) : make_tree(&tree, &transport, error);
  }
  if (status == CLT_OK) {
    status = write_sigma(&tree, transport, error);
  }
  finish_hierarchy(&tree);
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  *out = transport;
  return CLT_OK;
}

static int repeats_by_default(size_t cells) {
  (void)cells;
  return CLT_REPEATS_DEFAULT;
}

/* A guess until the first level is coloured. */
static long guess_patterns(const clt_session *session) {
  clt_pyramid pyramid = clt_pyramid_of(session->info.width, session->info.height);
  return 40L * (pyramid.levels - 1);
}

/* In proportion to tau over a floor of noise (docs/configuration.md). */
static double expected_error(const clt_session *session) {
  return 0.002 + 0.3 * session->options.threshold;
}

const clt_scheme clt_scheme_hierarchical = {"hierarchical", repeats_by_default,  guess_patterns, expected_error,
                                            false,          measure_hierarchical};
