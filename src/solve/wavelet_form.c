#include "solve/wavelet_form.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"
#include "solve/matrix.h"

enum {
  PROBES = 12,   /* at most; 1 and signs at scales up to 2^10 */
  BUCKETS = 128, /* of magnitudes, BUCKETS_PER_OCTAVE to a factor of 2, from 2^LEAST_EXPONENT up */
  BUCKETS_PER_OCTAVE = 4,
  LEAST_EXPONENT = -27,
  TILE = 64,              /* rows and columns that a transposition takes up at once */
  WORTH_SHARING = 1 << 17 /* coefficients from which threads pay */
};

/* What is needed only while a form is made. */
typedef struct making {
  size_t cells;
  float *entries;               /* R, then its coefficients; cells x cells, row-major */
  double *probes;               /* PROBES coefficients of each cell */
  double *scratch;              /* of every thread: two vectors */
  int count;                    /* of probes */
  double size[PROBES];          /* ||z|| */
  double left[BUCKETS][PROBES]; /* ||E z||^2 where all up to this bucket is left out */
} making;

static double *scratch_of(const making *work) {
  return work->scratch + 2 * work->cells * (size_t)omp_get_thread_num();
}

/* Row i of R, 0 at dark cells, in the wavelets of the columns. */
static clt_status take_row(const clt_wavelet_form *form, const clt_system *system, size_t i, double *values, float *to,
                           clt_error *error) {
  size_t cells = form->cells;
  if (!system->lit[i]) {
    return CLT_OK; /* the entries were zeroed */
  }
  clt_status status = clt_transport_row(system->transport, system->channel, i, values, error);
  for (size_t j = 0; j < cells && status == CLT_OK; j++) {
    values[j] = values[j] * system->scale[j] - (i == j ? 1 : 0);
  }
  if (status == CLT_OK) {
    clt_d4_forward(&form->d4, values, values + cells);
    for (size_t j = 0; j < cells; j++) {
      to[j] = (float)values[j];
    }
  }
  return status;
}

static clt_status take_rows(const clt_wavelet_form *form, const making *work, const clt_system *system,
                            clt_error *error) {
  clt_status worst = CLT_OK;
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < work->cells; i++) {
    clt_error of_row = {0};
    clt_status status = take_row(form, system, i, scratch_of(work), work->entries + i * work->cells, &of_row);
    if (status != CLT_OK) {
#pragma omp critical(clt_wavelet_form)
      {
        worst = status;
        *error = of_row;
      }
    }
  }
  return worst;
}

static void transpose(float *entries, size_t n) {
#pragma omp parallel for schedule(dynamic, 1)
  for (size_t top = 0; top < n; top += TILE) {
    for (size_t left = 0; left <= top; left += TILE) {
      for (size_t i = top; i < top + TILE && i < n; i++) {
        size_t end = left + TILE < i ? left + TILE : i;
        for (size_t j = left; j < end; j++) {
          float kept = entries[i * n + j];
          entries[i * n + j] = entries[j * n + i];
          entries[j * n + i] = kept;
        }
      }
    }
  }
}

/* M = W (R W'): the rows hold R W', and their columns are transformed as rows of the transpose. */
static void transform_columns(const clt_wavelet_form *form, const making *work) {
  size_t n = work->cells;
  transpose(work->entries, n);
#pragma omp parallel for schedule(static)
  for (size_t i = 0; i < n; i++) {
    double *values = scratch_of(work);
    float *row = work->entries + i * n;
    for (size_t j = 0; j < n; j++) {
      values[j] = (double)row[j];
    }
    clt_d4_forward(&form->d4, values, values + n);
    for (size_t j = 0; j < n; j++) {
      row[j] = (float)values[j];
    }
  }
  transpose(work->entries, n);
}

/* 1, then signs on blocks of 2^(k-1) cells a side; in coefficients. */
static void fill_probes(const clt_wavelet_form *form, making *work, const clt_system *system) {
  size_t cells = work->cells, width = form->d4.width, side = width > form->d4.height ? width : form->d4.height;
  double *values = work->scratch;
  work->count = 1;
  while (work->count < PROBES && (size_t)1 << (work->count - 1) < side) {
    work->count++;
  }
  for (int p = 0; p < work->count; p++) {
    size_t scale = p > 0 ? (size_t)1 << (p - 1) : 1;
    for (size_t i = 0; i < cells; i++) {
      uint64_t block = ((i / width / scale) << 32) + i % width / scale;
      double sign = p == 0 || clt_random_bits((uint64_t)p, block) >> 63 ? 1 : -1;
      values[i] = system->lit[i] ? sign : 0;
    }
    work->size[p] = clt_norm(cells, values);
    clt_d4_forward(&form->d4, values, values + cells);
    for (size_t i = 0; i < cells; i++) {
      work->probes[i * PROBES + (size_t)p] = values[i];
    }
  }
}

/* The magnitude step of a coefficient, from its exponent and the first two bits of its mantissa. */
static size_t bucket_of(float value) {
  union {
    float value;
    uint32_t bits;
  } as = {value};
  int step = (int)((as.bits & 0x7fffffffu) >> 21) - BUCKETS_PER_OCTAVE * (127 + LEAST_EXPONENT);
  return step < 0 ? 0 : step < BUCKETS ? (size_t)step : BUCKETS - 1;
}

/* Adds row i's part of ||E z||^2, whatever is left out: sums from the smallest bucket up. */
static void measure_row(const making *work, const float *row, double left[BUCKETS][PROBES]) {
  double part[BUCKETS][PROBES] = {{0}}, sum[PROBES] = {0};
  for (size_t j = 0; j < work->cells; j++) {
    double *to = part[bucket_of(row[j])], value = (double)row[j];
    const double *probe = work->probes + j * PROBES;
    for (int p = 0; p < PROBES; p++) {
      to[p] += value * probe[p];
    }
  }
  for (int b = 0; b < BUCKETS; b++) {
    for (int p = 0; p < PROBES; p++) {
      sum[p] += part[b][p];
      left[b][p] += sum[p] * sum[p];
    }
  }
}

static void measure(making *work) {
#pragma omp parallel
  {
    double left[BUCKETS][PROBES] = {{0}};
#pragma omp for schedule(static)
    for (size_t i = 0; i < work->cells; i++) {
      measure_row(work, work->entries + i * work->cells, left);
    }
#pragma omp critical(clt_wavelet_form)
    for (int b = 0; b < BUCKETS; b++) {
      for (int p = 0; p < PROBES; p++) {
        work->left[b][p] += left[b][p];
      }
    }
  }
}

static double worst_error(const making *work, size_t bucket) {
  double worst = 0;
  for (int p = 0; p < work->count; p++) {
    worst = fmax(worst, work->size[p] > 0 ? sqrt(work->left[bucket][p]) / work->size[p] : 0);
  }
  return worst;
}

/* The first bucket that is kept; form->error is what leaving out those below costs. */
static size_t choose_bucket(const making *work, double wanted, double *error) {
  size_t bucket = 1;
  while (bucket < BUCKETS && worst_error(work, bucket) <= wanted) {
    bucket++;
  }
  *error = worst_error(work, bucket - 1);
  return bucket;
}

/* How many of each row are kept, and the square of what is not. */
static double count_large(const making *work, size_t least, size_t *length) {
  size_t cells = work->cells;
  double squares = 0;
  for (size_t i = 0; i < cells; i++) {
    for (size_t j = 0; j < cells; j++) {
      float value = work->entries[i * cells + j];
      bool keep = bucket_of(value) >= least;
      length[i] += keep;
      squares += keep ? 0 : (double)value * (double)value;
    }
  }
  return squares;
}

/* Rows by their length, the longest first, by counting; places: cells + 1 zeros. */
static void order_rows(clt_wavelet_form *form, const size_t *length, size_t *places) {
  size_t cells = form->cells, before = 0;
  for (size_t i = 0; i < cells; i++) {
    places[cells - length[i]]++;
    form->kept += length[i];
  }
  for (size_t k = 0; k <= cells; k++) {
    size_t count = places[k];
    places[k] = before;
    before += count;
  }
  for (size_t i = 0; i < cells; i++) {
    form->row[places[cells - length[i]]++] = (uint32_t)i;
  }
  for (size_t place = cells; place < form->slices * CLT_WAVELET_SLICE; place++) {
    form->row[place] = (uint32_t)cells;
  }
  for (size_t slice = 0; slice < form->slices; slice++) {
    size_t longest = length[form->row[slice * CLT_WAVELET_SLICE]];
    form->first[slice + 1] = form->first[slice] + longest * CLT_WAVELET_SLICE;
  }
}

static void fill_slices(clt_wavelet_form *form, const making *work, size_t least) {
  size_t cells = form->cells;
#pragma omp parallel for schedule(dynamic, 16)
  for (size_t place = 0; place < cells; place++) {
    size_t next = form->first[place / CLT_WAVELET_SLICE] + place % CLT_WAVELET_SLICE;
    const float *from = work->entries + form->row[place] * cells;
    for (size_t j = 0; j < cells; j++) {
      if (bucket_of(from[j]) >= least) {
        form->column[next] = (uint16_t)j;
        form->value[next] = from[j];
        next += CLT_WAVELET_SLICE;
      }
    }
  }
}

static clt_status keep_large(clt_wavelet_form *form, const making *work, size_t least, clt_error *error) {
  size_t cells = work->cells, *length = clt_alloc(2 * cells + 1, sizeof *length);
  if (length == NULL) {
    return clt_fail(error, CLT_FAILED, "wavelet: not enough memory for the lengths of %zu rows", cells);
  }
  form->dropped = sqrt(count_large(work, least, length));
  order_rows(form, length, length + cells);
  free(length);
  form->column = clt_alloc(form->first[form->slices], sizeof *form->column);
  form->value = clt_alloc(form->first[form->slices], sizeof *form->value);
  if (form->column == NULL || form->value == NULL) {
    return clt_fail(error, CLT_FAILED, "wavelet: not enough memory for %zu coefficients; use pcg or gmres", form->kept);
  }
  fill_slices(form, work, least);
  return CLT_OK;
}

static clt_status reserve(clt_wavelet_form *form, making *work, clt_error *error) {
  size_t cells = work->cells, threads = (size_t)omp_get_max_threads();
  form->slices = (cells + CLT_WAVELET_SLICE - 1) / CLT_WAVELET_SLICE;
  form->first = clt_alloc(form->slices + 1, sizeof *form->first);
  form->row = clt_alloc(form->slices, CLT_WAVELET_SLICE * sizeof *form->row);
  work->entries = clt_alloc(cells * cells, sizeof *work->entries);
  work->probes = clt_alloc(cells, PROBES * sizeof *work->probes);
  work->scratch = clt_alloc(2 * cells, threads * sizeof *work->scratch);
  return form->first != NULL && form->row != NULL && work->entries != NULL && work->probes != NULL &&
                 work->scratch != NULL
             ? CLT_OK
             : clt_fail(error, CLT_FAILED, "wavelet: not enough memory for %zu x %zu entries; use pcg or gmres", cells,
                        cells);
}

static clt_status make(clt_wavelet_form *form, making *work, const clt_system *system, double wanted,
                       clt_error *error) {
  clt_status status = reserve(form, work, error);
  if (status == CLT_OK) {
    status = take_rows(form, work, system, error);
  }
  if (status != CLT_OK) {
    return status;
  }
  transform_columns(form, work);
  fill_probes(form, work, system);
  measure(work);
  return keep_large(form, work, choose_bucket(work, wanted, &form->error), error);
}

clt_status clt_wavelet_form_init(clt_wavelet_form *form, const clt_system *system, double wanted, clt_error *error) {
  clt_transport_info info = clt_transport_describe(system->transport);
  if (system->cols > CLT_MATRIX_CELLS_MAX) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "wavelet needs every entry of T, but %zu cells are more than the %d that it is built for; use pcg, "
                    "gmres or auto, which need only products",
                    system->cols, CLT_MATRIX_CELLS_MAX);
  }
  form->cells = system->cols;
  clt_d4_init(&form->d4, (size_t)info.width, (size_t)info.height);
  making *work = clt_alloc(1, sizeof *work);
  if (work == NULL) {
    return clt_fail(error, CLT_FAILED, "wavelet: not enough memory");
  }
  work->cells = form->cells;
  clt_status status = make(form, work, system, wanted, error);
  free(work->entries);
  free(work->probes);
  free(work->scratch);
  free(work);
  return status;
}

void clt_wavelet_form_finish(clt_wavelet_form *form) {
  free(form->first);
  free(form->row);
  free(form->column);
  free(form->value);
  *form = (clt_wavelet_form){0};
}

void clt_wavelet_form_apply(const clt_wavelet_form *form, const double *c, double *out) {
#pragma omp parallel for schedule(static, 16) if (form->kept >= WORTH_SHARING)
  for (size_t slice = 0; slice < form->slices; slice++) {
    double sum[CLT_WAVELET_SLICE] = {0};
    for (size_t k = form->first[slice]; k < form->first[slice + 1]; k += CLT_WAVELET_SLICE) {
      for (size_t l = 0; l < CLT_WAVELET_SLICE; l++) {
        sum[l] += (double)form->value[k + l] * c[form->column[k + l]];
      }
    }
    for (size_t l = 0; l < CLT_WAVELET_SLICE; l++) {
      size_t row = form->row[slice * CLT_WAVELET_SLICE + l];
      if (row < form->cells) {
        out[row] = sum[l];
      }
    }
  }
}
