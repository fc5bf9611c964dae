/* Inversion: the drive x in 0..1 that makes T x come nearest to a wanted observation.
 *
 * With F = diag(T), S = T F^-1 and R = S - I (Bai et al. 2010, eq. 5, 12) the methods solve S l = b, l = F x, per
 * colour channel. Dark cells (F not above the noise, or not finite) take no part: their drive is fixed at 0 and their
 * rows are dropped. Arrays over a channel set are channel after channel. */
#ifndef COUNTERLIGHT_SOLVE_H
#define COUNTERLIGHT_SOLVE_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/image.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is known of T before any target: made once per transport. */
typedef struct clt_certificate clt_certificate;

typedef struct clt_channel_certificate {
  size_t lit, dark;               /* cells that take part, cells that do not */
  double radius_low, radius_high; /* Collatz-Wielandt bounds: radius_low <= rho(R) <= radius_high */
  double norm_high;               /* upper bound of ||R||_2 from sqrt(||R||_1 ||R||_inf) */
  double reciprocity; /* defect of the flux-scaled S: ||(S W - (S W)') z|| / ||S W z||, the worst of probes z at every
                         scale */
  double white;       /* median over lit cells of F: the radiance that white means by default */
} clt_channel_certificate;

/* Bounds by at most 8 power steps from x = 1 (radius_high with the negative entries of a dense R clipped to 0,
 * radius_low with R as it stands, whose noise averages out), flux weights w such that S diag(w) is nearest to
 * symmetric, dark cells from F (below 1e-3 of the 90th percentile) and the transport's sigma (below 5 of them). Where
 * rows != cols there is no diagonal: a column's sum stands for F, and radius_high, norm_high and reciprocity are
 * infinite (not known). CLT_BAD_INPUT where a value that takes part is not a number, and where no cell shows its own
 * light though light goes elsewhere (a mirror, rows out of order; of a T without sigma). */
CLT_PUBLIC clt_status clt_certify(const clt_transport *transport, clt_certificate **out, clt_error *error);
/* The `white` of every channel alone (channels values): without the products that the bounds take. */
CLT_PUBLIC clt_status clt_certify_white(const clt_transport *transport, double *white, clt_error *error);
CLT_PUBLIC void clt_certificate_destroy(clt_certificate *certificate);
CLT_PUBLIC const clt_channel_certificate *clt_certificate_channel(const clt_certificate *certificate, int channel);
/* lit[i] != 0 where cell i of the channel takes part; cols values, owned by the certificate. */
CLT_PUBLIC const unsigned char *clt_certificate_lit(const clt_certificate *certificate, int channel);
/* Whether any cell of any channel takes part: else no drive changes what is seen. */
CLT_PUBLIC bool clt_certificate_any_lit(const clt_certificate *certificate);
/* F = diag(T) of the channel (cols values), and the flux weights w (cols values, mean 1 over lit cells). */
CLT_PUBLIC const double *clt_certificate_first_bounce(const clt_certificate *certificate, int channel);
CLT_PUBLIC const double *clt_certificate_flux(const clt_certificate *certificate, int channel);

typedef struct clt_solve_options {
  const char *method;  /* a name from clt_method_name, or "auto" (NULL means "auto") */
  double tolerance;    /* relative residual ||T x - b|| / ||b|| over lit rows to stop at, > 0; 0 means 1e-4. "bounded":
                          ||l - P(l - g)|| relative to its value at x = 0, with l = F x, g the gradient in l and P the
                          projection on 0 <= l <= F */
  int iteration_limit; /* > 0; 0 means 1000 */
  double deadline_s;   /* wall time after which the best drive so far is returned; <= 0 means none */
  const double *start; /* warm start of clt_solve: channels * cols drive values, or NULL for zero */
  bool together;       /* the channels as one system: they iterate in step, and storage that they share is read once for
                          all; each still reaches the tolerance. The methods that need the entries of T solve channel by
                          channel all the same */
  bool discrepancy; /* stop where only noise is left (the discrepancy principle): at ||r|| <= 1.05 sqrt(M) sqrt(noise^2
                       + sigma_T^2 ||x||^2), M lit rows, sigma_T from the transport's sigma, if `tolerance` asks for
                       less */
  double noise;     /* standard deviation of a wanted value (radiance), >= 0, for `discrepancy` */
  bool trust;       /* a linear method that converged is believed: its own figure is the `residual` (of the wavelets a
                       bound, kept to in 999 of 1000 solves), and no product with T is spent to measure it */
} clt_solve_options;

typedef struct clt_solve_result {
  char method[24];        /* the method that gave the answer */
  char reason[320];       /* why this one, in one sentence; of auto with what it expected */
  int iterations;         /* the most that any channel took */
  long products;          /* with T or T', the most that any channel took; channels together count as one */
  double residual;        /* ||T x - b|| / ||b|| over lit rows of every channel, of the x that is returned;
                             measured at the end, if not by `trust` */
  double seconds;         /* wall time of the solve */
  double method_seconds;  /* of it, in the methods themselves: without the product that `residual` takes */
  double prepare_seconds; /* wall time that making the method ready took, once for every solve with the solver */
  bool converged;         /* false where the iteration limit or the deadline came first */
  size_t curve_count;     /* residual after iteration k, k = 0.. (channels together), for convergence plots */
  double curve[256];
} clt_solve_result;

/* The names of the methods, in order: index 0.. until NULL. */
CLT_PUBLIC const char *clt_method_name(size_t index);
/* One sentence on what the method is and when it serves. */
CLT_PUBLIC const char *clt_method_summary(size_t index);
/* True where making the method ready costs as much as many solves by products: it serves one transport and many
 * targets.
 */
CLT_PUBLIC bool clt_method_invests(size_t index);

/* What a method is expected to take, before it runs: told by the certificate, which tried S on a random picture (16
 * products with T a channel) and timed that. Pictures differ, and so does a machine from one minute to the next. Expect
 * the iterations of series, jacobi, damped, chebyshev, pcg, deflated-pcg and gmres within one or half as many again,
 * those of the others mostly within a factor of two, at worst of six (docs/solving.md). */
typedef struct clt_forecast {
  bool possible;
  char why_not[CLT_MESSAGE_MAX]; /* where it is not possible: the reason */
  int iterations;                /* the most of any channel; < 0: not known (rows != cols) */
  double residual;        /* ||T x - b|| / ||b|| then: the tolerance, or more where limit or deadline come first */
  double seconds;         /* of a solve, every channel; < 0: not known */
  double prepare_seconds; /* before the first solve */
} clt_forecast;

/* Foretells a solve of the method, tolerance, limit and deadline of `options` (NULL and "auto": what auto would take).
 * A method that the certificate refuses is no failure: `possible` is false then. CLT_BAD_INPUT for options out of range
 * and a method that does not exist. "bounded" is foretold for a target that can be reached; one that cannot be takes up
 * to several times as long. */
CLT_PUBLIC clt_status clt_forecast_solve(const clt_transport *transport, const clt_certificate *certificate,
                                         const clt_solve_options *options, clt_forecast *out, clt_error *error);

/* A method made ready for one transport: its workspace, and what it keeps from solve to solve (a factor, a stored
 * inverse). One solve at a time. */
typedef struct clt_solver clt_solver;

/* Makes the method of `options` (NULL: all defaults; `start` is not read) ready, or every method that "auto" may take.
 * A method that the certificate shows to diverge, or that needs more memory than it may take, is refused
 * (CLT_BAD_INPUT with the reason and what to take instead), and so are a method that does not exist (the message lists
 * those that do) and options out of range. transport and certificate outlive the solver. */
CLT_PUBLIC clt_status clt_solver_create(const clt_transport *transport, const clt_certificate *certificate,
                                        const clt_solve_options *options, clt_solver **out, clt_error *error);
CLT_PUBLIC void clt_solver_destroy(clt_solver *solver); /* accepts NULL */

/* Solves for drive (channels * cols values) with wanted (channels * rows values: target less black), from `start`
 * (channels * cols drive values; NULL: zero). "bounded" and "auto" keep 0 <= drive <= 1; the other methods solve the
 * unbounded system and leave drive unclipped. A method that diverges in spite of its certificate is detected and
 * replaced, which method and reason of the result tell. CLT_BAD_INPUT for a wanted or a start that is not finite. */
CLT_PUBLIC clt_status clt_solver_run(clt_solver *solver, const double *wanted, const double *start, double *drive,
                                     clt_solve_result *result, clt_error *error);

/* One solve with a solver of its own, from options->start. */
CLT_PUBLIC clt_status clt_solve(const clt_transport *transport, const clt_certificate *certificate,
                                const double *wanted, const clt_solve_options *options, double *drive,
                                clt_solve_result *result, clt_error *error);

/* What a compensation is asked for. */
typedef enum clt_white_kind { CLT_WHITE_AUTO, CLT_WHITE_FEASIBLE, CLT_WHITE_VALUE } clt_white_kind;
typedef struct clt_white {
  clt_white_kind kind; /* AUTO: median F per channel; FEASIBLE: the largest that every lit cell can reach */
  double value;        /* CLT_WHITE_VALUE: radiance of white, > 0 */
} clt_white;
/* Reads "auto", "feasible" or a positive number. */
CLT_PUBLIC clt_status clt_white_parse(const char *text, clt_white *white, clt_error *error);

/* What a drive will look like and how good it can get. Errors are relative RMS over lit cells of every channel,
 * ||y - target|| / ||target||, in linear light. */
typedef struct clt_compensation {
  clt_solve_result solve;
  double white[CLT_CHANNELS_MAX]; /* radiance that 1.0 in the picture stands for */
  double error_before;            /* drive = picture, after the best single brightness factor */
  double error_after;             /* predicted for the drive that is returned */
  double error_limit;             /* the least that any drive in 0..1 can reach; < 0 where it was not asked for */
  double clipped_fraction;        /* lit cells whose drive is at 0 or 1 */
} clt_compensation;

/* The drive in 0..1 that makes `picture` (linear, the transport's width, height and channels, values >= 0) appear:
 * target = white * picture, wanted = target - b0. drive is initialised here. An unbounded method's answer is clipped to
 * 0..1 before its error is taken. find_limit also solves the bounded problem to its optimum for error_limit. */
CLT_PUBLIC clt_status clt_compensate(const clt_transport *transport, const clt_certificate *certificate,
                                     const clt_image *picture, const clt_white *white, const clt_solve_options *options,
                                     bool find_limit, clt_image *drive, clt_compensation *result, clt_error *error);

/* The wanted radiance white * picture; target is initialised here, and white_value (channels values) is filled. */
CLT_PUBLIC clt_status clt_target(const clt_transport *transport, const clt_certificate *certificate,
                                 const clt_image *picture, const clt_white *white, clt_image *target,
                                 double *white_value, clt_error *error);

/* b0 + T drive; seen is initialised here. Needs rows = cols. */
CLT_PUBLIC clt_status clt_predict(const clt_transport *transport, const clt_image *drive, clt_image *seen,
                                  clt_error *error);

/* The single brightness factor that brings seen nearest to target over lit cells, <seen, target> / <seen, seen>; 1
 * where nothing is seen. */
CLT_PUBLIC double clt_best_gain(const clt_certificate *certificate, const clt_image *seen, const clt_image *target);

/* ||gain * seen - target|| / ||target|| over lit cells; with best_gain the gain that makes it least, else gain 1. For a
 * target that is black everywhere the distance is taken relative to white in place of the target. */
CLT_PUBLIC double clt_appearance_error(const clt_certificate *certificate, const clt_image *seen,
                                       const clt_image *target, bool best_gain);

#ifdef __cplusplus
}
#endif
#endif
