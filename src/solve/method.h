/* What a method of inversion is: one file each, collected in the table of solve.c. */
#ifndef CLT_SOLVE_METHOD_H
#define CLT_SOLVE_METHOD_H

#include <stdint.h>

#include "counterlight/solve.h"
#include "solve/model.h"
#include "solve/system.h"

/* A reciprocity defect up to here lets conjugate gradients converge. */
#define CLT_RECIPROCAL 0.1

typedef enum clt_outcome {
  CLT_RUN_CONVERGED,
  CLT_RUN_STOPPED, /* by the iteration limit, the deadline or the precision of double; light holds the best */
  CLT_RUN_BROKE    /* the method does not fit this system (note says why); light holds the best so far */
} clt_outcome;

enum { CLT_CURVE_MAX = 256, CLT_NOTE_MAX = 128 };

/* What noise leaves of a residual (NUMERICS: the discrepancy principle); zeros where it is not asked for. */
typedef struct clt_noise {
  double observed;                  /* sum over lit rows of the variance of an observation */
  double entries[CLT_CHANNELS_MAX]; /* of each channel in the system: sum over lit rows of the variance of an entry */
} clt_noise;

/* One system's way through a method: its limits, and what is told of it. */
typedef struct clt_run {
  double tolerance;
  clt_noise noise;
  int iteration_limit; /* counts down from the start of the channel, over every method that runs on it */
  int64_t start_ns;
  double deadline_s;           /* since start_ns; <= 0: none */
  double radius_high;          /* the certificate's bound of rho(R) */
  int iterations;              /* done so far */
  size_t curve_count;          /* of the method that runs now */
  double curve[CLT_CURVE_MAX]; /* ||b - S l|| after each iteration */
  double norm;                 /* the latest of it */
  char note[CLT_NOTE_MAX];     /* why the method broke */
} clt_run;

typedef struct clt_method {
  const char *name, *summary;
  bool bounded;     /* keeps 0 <= x <= 1 */
  bool rectangular; /* takes systems with rows != cols */
  bool apart;       /* works on single channels only */
  bool invests;     /* making it ready costs as much as many solves by products */
  size_t vectors;
  /* NULL, or fails with CLT_BAD_INPUT where the certificate of a channel shows that the method cannot serve. */
  clt_status (*check)(const clt_channel_certificate *channel, clt_error *error);
  /* Fills what a solve of a channel is expected to take (model.h), on a channel of a transport with rows = cols. */
  void (*expect)(clt_effort *effort);
  /* NULL, or makes what the method keeps of the selected system for every solve (a factor, a table). The caller ends
   * *prepared by `release` in either case. */
  clt_status (*prepare)(clt_system *system, void **prepared, clt_error *error);
  void (*release)(void *prepared); /* accepts NULL and half-built ones; NULL where there is no `prepare` */
  /* Improves system->light until ||b - S l|| <= clt_run_target; needs `vectors` reserved, system->prepared, b != 0. */
  clt_outcome (*run)(clt_system *system, clt_run *run);
} clt_method;

extern const clt_method clt_method_series, clt_method_jacobi, clt_method_damped, clt_method_chebyshev, clt_method_pcg,
    clt_method_deflated_pcg, clt_method_gmres, clt_method_lsmr, clt_method_bounded;
/* those that need the entries of T */
extern const clt_method clt_method_gauss_seidel, clt_method_sor, clt_method_southwell, clt_method_direct,
    clt_method_stored_inverse, clt_method_matrix, clt_method_clusters, clt_method_wavelet, clt_method_montecarlo,
    clt_method_hybrid;

/* Every method, ended by NULL (table.c). */
extern const clt_method *const clt_methods[];
/* The method of that name, or NULL. */
const clt_method *clt_method_find(const char *name);

/* The Krylov method that the reciprocity defect allows: pcg or gmres. */
const clt_method *clt_method_linear(double reciprocity);

/* What noise leaves of the residual of system->light, 1.05 sqrt(sum sigma_c^2 + sum sigma_T^2 ||x||^2); 0 where it was
 * not asked for. */
double clt_run_noise(const clt_run *run, const clt_system *system);
/* The ||b - S l|| at which a run has done its work: tolerance ||b||, of the faintest channel where several are
 * together, or what noise leaves if that is more. */
double clt_run_target(const clt_run *run, const clt_system *system);
/* The residual before the first iteration opens the curve. */
void clt_run_open(clt_run *run, double norm);
/* Counts an iteration that ended with this residual. */
void clt_run_count(clt_run *run, double norm);
/* False where the limit or the deadline has come. */
bool clt_run_may_go_on(const clt_run *run);
void clt_run_note(clt_run *run, const char *format, ...) CLT_PRINTF(2, 3);

/* GMRES for any operator on n values (Saad & Schultz 1986). */
enum { CLT_GMRES_STEPS = 24, CLT_GMRES_VECTORS = CLT_GMRES_STEPS + 1 };
typedef struct clt_gmres {
  void (*apply)(void *context, const double *in, double *out);
  void *context;
  size_t count;
  double *basis; /* CLT_GMRES_VECTORS vectors, stride apart */
  size_t stride;
  double target; /* residual norm to stop at */
} clt_gmres;
/* One cycle: adds to x the d of the Krylov space of r that makes ||r - A d|| least. r of norm `norm` stays. */
void clt_gmres_cycle(const clt_gmres *gmres, clt_run *run, const double *r, double norm, double *x);

/* Fills w (cols values, 0 at dark cells, mean 1 over lit ones) so that S diag(w) is nearest to symmetric, and returns
 * the reciprocity defect that is left. Needs CLT_FLUX_VECTORS reserved. */
enum { CLT_FLUX_VECTORS = CLT_GMRES_VECTORS + 4 };
double clt_flux_weights(clt_system *system, double *w);

/* The worst figures of any channel: the method must serve all of them. */
clt_channel_certificate clt_certificate_worst(const clt_certificate *certificate);
/* T 1 over the lit cells of a channel, rows values. */
const double *clt_certificate_flood(const clt_certificate *certificate, int channel);
/* S times that, rows values; 0 where T is not square. */
const double *clt_certificate_reflood(const clt_certificate *certificate, int channel);
/* The small copy of S of a channel. */
const clt_model *clt_certificate_model(const clt_certificate *certificate, int channel);
/* True where the certificate was made for a transport of this shape. */
bool clt_certificate_fits(const clt_certificate *certificate, const clt_transport *transport);

#endif
