/* Flood blocks and a direct scan (NUMERICS section 6).
 *
 * What differs from cell to cell is direct light, and what comes from next door: a scan of sparse grids measures it.
 * The rest is smooth: the light of a block of cells is photographed in every cell, and reciprocity completes it
 * (clt_block_parts in counterlight/transport.h), so that what is uneven in a block is missing only where it would be
 * seen unevenly in another. Blocks are cut in two where that part is expected to be largest; the second half is what
 * the first leaves of the whole, so that a cut takes one photograph, and all columns add up to the flood.
 *
 * Test pictures that light a quarter of every block show directly what the blocks do not resolve. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "acquire/direct_scan.h"
#include "acquire/flux_fit.h"
#include "acquire/partition.h"
#include "acquire/session.h"
#include "base/memory.h"

enum { BLOCKS_MAX = 256, REPEATS = 4, FIRST_TEST = 8 };
/* A cell is dark where its own light is below this part of the brightest, or below this many deviations. */
#define DARK_SHARE 1e-3
#define DARK_SIGMAS 4.0
/* What a picture is off by, as part of what a test picture is that lights a quarter of every block: figures in
 * docs/acquisition.md. */
#define TEST_SHARE 0.7

typedef struct flood_blocks {
  clt_session *session;
  size_t cells;
  int channels;
  double scale[CLT_CHANNELS_MAX]; /* largest flood, per channel */
  clt_near near;
  clt_partition partition;
  float *column[BLOCKS_MAX]; /* far light of each block, channels x cells */
  float *variance;           /* of a row's columns together, channels x cells */
  float *light;              /* room for near light, cells */
  float *flux;
  unsigned char *dark;
} flood_blocks;

static int repeats_of_black(size_t cells) {
  (void)cells;
  return REPEATS;
}

/* The wanted error, above a floor of noise. */
static double expected_error(const clt_session *session) {
  return fmax(session->options.error, 0.006);
}

/* In diffuse rooms an error of .02 takes 20 blocks, and half of it four times as many (docs/acquisition.md). */
static long count_patterns(const clt_session *session) {
  const double finer = 0.02 / expected_error(session), blocks = 20 * fmax(finer * finer, 0.4);
  const double most = session->cells < BLOCKS_MAX ? (double)session->cells : BLOCKS_MAX;
  return CLT_SCAN_PATTERNS + lrint(fmin(blocks, most)) + 1 + lrint(log(fmin(blocks, most) / FIRST_TEST + 1) / log(1.5));
}

static clt_status init(flood_blocks *own, clt_session *session, clt_error *error) {
  const size_t cells = session->cells, values = cells * (size_t)session->info.channels;
  *own = (flood_blocks){.session = session,
                        .cells = cells,
                        .channels = session->info.channels,
                        .variance = clt_alloc(values, sizeof(float)),
                        .light = clt_alloc(cells, sizeof(float)),
                        .flux = clt_alloc(cells, sizeof(float)),
                        .dark = clt_alloc(cells, 1)};
  if (own->variance == NULL || own->light == NULL || own->flux == NULL || own->dark == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for blocks over %zu cells", cells);
  }
  for (int c = 0; c < own->channels; c++) {
    double largest = 0;
    for (size_t i = 0; i < cells; i++) {
      largest = fmax(largest, (double)session->flood.data[(size_t)c * cells + i]);
    }
    own->scale[c] = largest > 0 ? largest : 1;
  }
  const int32_t most = cells < BLOCKS_MAX ? (int32_t)cells : BLOCKS_MAX;
  return clt_partition_init(&own->partition, session->info.width, session->info.height, own->channels, own->scale, most,
                            error);
}

static void finish(flood_blocks *own) {
  for (int b = 0; b < BLOCKS_MAX; b++) {
    free(own->column[b]);
  }
  free(own->variance);
  free(own->light);
  free(own->flux);
  free(own->dark);
  clt_near_finish(&own->near);
  clt_partition_finish(&own->partition);
}

/* column = seen less the near light of block b. */
static void take_far(flood_blocks *own, int32_t b, const float *seen) {
  for (int c = 0; c < own->channels; c++) {
    clt_near_light(&own->near, own->cells, c, own->partition.label, b, own->light);
    for (size_t i = 0; i < own->cells; i++) {
      own->column[b][(size_t)c * own->cells + i] = seen[(size_t)c * own->cells + i] - own->light[i];
    }
  }
}

/* The mean over rows of a variance, in squared scales; rows that were not seen are left out. */
static double mean_variance(const flood_blocks *own, const float *variance) {
  double sum = 0, count = 0;
  for (size_t at = 0; at < own->cells * (size_t)own->channels; at++) {
    const double scale = own->scale[at / own->cells];
    if (isfinite(variance[at])) {
      sum += (double)variance[at] / (scale * scale);
      count += 1;
    }
  }
  return count > 0 ? sum / count * own->channels : 0;
}

static clt_status make_column(flood_blocks *own, int32_t b, clt_error *error) {
  own->column[b] = clt_alloc(own->cells, (size_t)own->channels * sizeof(float));
  return own->column[b] != NULL ? CLT_OK : clt_fail(error, CLT_FAILED, "out of memory for block %d", b + 1);
}

/* The first block is the grid, its light the flood. */
static clt_status take_flood(flood_blocks *own, clt_error *error) {
  const clt_session *session = own->session;
  clt_status status = make_column(own, 0, error);
  if (status == CLT_OK) {
    take_far(own, 0, session->flood.data);
    memcpy(own->variance, session->flood_variance.data, own->cells * (size_t)own->channels * sizeof(float));
    own->partition.variance[0] = mean_variance(own, own->variance);
    clt_partition_look(&own->partition, 0, 0, own->column[0]);
  }
  return status;
}

static void light_block(flood_blocks *own, int32_t b) {
  clt_image *drive = &own->session->drive;
  for (size_t at = 0; at < own->cells * (size_t)own->channels; at++) {
    drive->data[at] = own->partition.label[at % own->cells] == b ? 1 : 0;
  }
}

/* The last observation as the light of the new block b, a part of `from`: both columns, and what is known of them. */
static void take_half(flood_blocks *own, int32_t from, int32_t b) {
  clt_session *session = own->session;
  const size_t values = own->cells * (size_t)own->channels;
  for (size_t at = 0; at < values; at++) {
    const float deviation = session->deviation.data[at];
    session->deviation.data[at] = deviation * deviation + session->black_variance.data[at];
    session->seen.data[at] -= session->black.data[at];
  }
  take_far(own, b, session->seen.data);
  for (size_t at = 0; at < values; at++) {
    if (!isfinite(session->deviation.data[at])) {
      own->column[b][at] = own->column[from][at] / 2;
    }
    own->column[from][at] -= own->column[b][at];
    own->variance[at] += 2 * session->deviation.data[at];
  }
  const double variance = mean_variance(own, session->deviation.data);
  own->partition.variance[b] = variance;
  own->partition.variance[from] += variance;
  for (int32_t k = 0; k < own->partition.count; k++) {
    clt_partition_look(&own->partition, k, from, own->column[from]);
    clt_partition_look(&own->partition, k, b, own->column[b]);
    clt_partition_look(&own->partition, from, k, own->column[k]);
    clt_partition_look(&own->partition, b, k, own->column[k]);
  }
}

static clt_status cut_block(flood_blocks *own, int32_t from, bool down, clt_error *error) {
  const int32_t half = clt_partition_cut(&own->partition, from, down);
  light_block(own, half);
  clt_status status = make_column(own, half, error);
  if (status == CLT_OK) {
    status = clt_session_observe(own->session, "blocks", error);
  }
  if (status == CLT_OK) {
    take_half(own, from, half);
  }
  return status;
}

/* A cell whose own light is lost in noise in every channel. */
static void find_dark(flood_blocks *own) {
  const int64_t entries = own->near.start[own->cells];
  double brightest[CLT_CHANNELS_MAX] = {0};
  memset(own->dark, 1, own->cells);
  for (int pass = 0; pass < 2; pass++) {
    for (size_t i = 0; i < own->cells; i++) {
      for (int64_t e = own->near.start[i]; e < own->near.start[i + 1]; e++) {
        for (int c = 0; c < own->channels && own->near.cell[e] == (int32_t)i; c++) {
          const double direct = (double)own->near.value[c * entries + e];
          const double deviation = sqrt((double)own->near.variance[(size_t)c * own->cells + i]);
          brightest[c] = fmax(brightest[c], direct);
          own->dark[i] = own->dark[i] && !(direct > fmax(DARK_SHARE * brightest[c], DARK_SIGMAS * deviation));
        }
      }
      own->dark[i] = own->dark[i] || pass == 0;
    }
  }
}

static clt_status make_transport(flood_blocks *own, clt_transport **out, clt_error *error) {
  const clt_rig_info *info = &own->session->info;
  const size_t count = (size_t)own->partition.count, cells = own->cells, channels = (size_t)own->channels;
  float *columns = clt_alloc(count * cells, channels * sizeof *columns);
  if (columns == NULL) {
    return clt_fail(error, CLT_FAILED, "out of memory for a transport of %zu blocks", count);
  }
  for (size_t c = 0; c < channels; c++) {
    for (size_t b = 0; b < count; b++) {
      memcpy(columns + (c * count + b) * cells, own->column[b] + c * cells, cells * sizeof *columns);
    }
  }
  const clt_block_parts parts = {.count = own->partition.count,
                                 .block = own->partition.label,
                                 .flux = own->flux,
                                 .column = columns,
                                 .start = own->near.start,
                                 .cell = own->near.cell,
                                 .value = own->near.value};
  clt_status status = clt_fit_flux(&own->partition, own->column, own->dark, own->flux, error);
  if (status == CLT_OK) {
    status = clt_transport_create_blocks(info->width, info->height, info->channels, &parts, out, error);
  }
  free(columns);
  return status;
}

/* Whether a place lies in the wanted half of a side; a side of one cell has no halves. */
static bool in_half(int place, int side, bool second) {
  return side == 1 || (2 * place >= side) == second;
}

/* Lights the quarter of every block that a hash of its number chooses: uneven across and down. */
static void light_quarters(flood_blocks *own) {
  clt_image *drive = &own->session->drive;
  for (size_t at = 0; at < own->cells * (size_t)own->channels; at++) {
    const int cell = (int)(at % own->cells);
    const int32_t b = own->partition.label[cell];
    const clt_block box = own->partition.box[b];
    const unsigned hash = ((unsigned)b * 2654435761u + (unsigned)own->partition.count * 40503u) >> 13;
    const bool lit = in_half(cell % drive->width - box.x, box.width, (hash & 1) != 0) &&
                     in_half(cell / drive->width - box.y, box.height, (hash & 2) != 0);
    drive->data[at] = lit ? 1 : 0;
  }
}

/* Relative RMS of what the model misses of a picture that is uneven in every block. */
static clt_status test_quarters(flood_blocks *own, double *relative, clt_error *error) {
  clt_transport *transport = NULL;
  light_quarters(own);
  clt_status status = clt_session_test(own->session, "test", error);
  if (status == CLT_OK) {
    status = make_transport(own, &transport, error);
  }
  if (status == CLT_OK) {
    status = clt_session_miss(own->session, transport, relative, error);
  }
  clt_transport_destroy(transport);
  return status;
}

/* Cuts blocks until a test picture is predicted well enough, no cut promises more than noise, or patterns run out. */
static clt_status refine(flood_blocks *own, clt_error *error) {
  const clt_acquire_options *options = &own->session->options;
  int32_t next_test = FIRST_TEST;
  clt_status status = CLT_OK;
  while (status == CLT_OK && own->partition.count < own->partition.most && clt_session_may_go_on(own->session)) {
    int32_t block = 0;
    bool down = false;
    double missing = INFINITY;
    if (!(clt_partition_choose(&own->partition, &block, &down) > 0)) {
      break;
    }
    status = cut_block(own, block, down, error);
    if (status == CLT_OK && own->partition.count == next_test) {
      next_test += next_test / 2;
      status = test_quarters(own, &missing, error);
    }
    if (status == CLT_OK && TEST_SHARE * missing <= options->error) {
      break;
    }
  }
  return status;
}

/* The deviation of one entry that gives an appearance the error that near entries and columns give it together. */
static clt_status write_sigma(const flood_blocks *own, clt_transport *transport, clt_error *error) {
  clt_status status = clt_transport_keep_sigma(transport, error);
  for (int c = 0; status == CLT_OK && c < own->channels; c++) {
    float *sigma = clt_transport_sigma_values(transport, c);
    for (size_t i = 0; i < own->cells; i++) {
      const size_t at = (size_t)c * own->cells + i;
      const double variance = (double)own->near.variance[at] + (double)own->variance[at];
      sigma[i] = (float)sqrt(variance / (double)own->cells);
    }
  }
  return status;
}

static clt_status measure_blocks(clt_session *session, clt_transport **out, clt_error *error) {
  flood_blocks own;
  clt_transport *transport = NULL;
  clt_status status = init(&own, session, error);
  if (status == CLT_OK) {
    status = clt_scan_direct(session, &own.near, error);
  }
  if (status == CLT_OK) {
    find_dark(&own);
    status = take_flood(&own, error);
  }
  if (status == CLT_OK) {
    status = refine(&own, error);
  }
  if (status == CLT_OK) {
    status = make_transport(&own, &transport, error);
  }
  if (status == CLT_OK) {
    status = write_sigma(&own, transport, error);
  }
  finish(&own);
  if (status != CLT_OK) {
    clt_transport_destroy(transport);
    return status;
  }
  *out = transport;
  return CLT_OK;
}

const clt_scheme clt_scheme_blocks = {"blocks", repeats_of_black, count_patterns, expected_error, true, measure_blocks};
