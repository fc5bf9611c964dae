/* Analysis of light that was measured: bounces, direct and global light, the dual photograph, repainted surfaces.
 *
 * Of T = S F only S^-1 = I - A is known through products: A l = l - F T^-1 l is the light l after one more bounce (Bai
 * et al. 2010, eq. 9, 51). Light is radiance less black, over the cells of a camera that shares the projector's grid
 * (rows = cols); arrays hold channels * cells doubles, channel after channel, unless a comment says otherwise.
 *
 * Cells that the projector does not light (dark, by the certificate) are part of the room but not of T^-1: what returns
 * from them counts as the bounce that it follows, and what they show of bounce k is C b_(k-1), C = S_dl S_ll^-1, l the
 * lit cells and d the dark ones. docs/analysis.md has the algebra and what was measured. */
#ifndef COUNTERLIGHT_ANALYSIS_H
#define COUNTERLIGHT_ANALYSIS_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/image.h"
#include "counterlight/rig.h"
#include "counterlight/solve.h"
#include "counterlight/status.h"
#include "counterlight/transport.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A transport made ready for products with A = I - F T^-1. One call at a time. */
typedef struct clt_interreflection clt_interreflection;

enum { CLT_EXACT_CELLS_MAX = 6400, CLT_BOUNCES_MAX = 64 };

typedef struct clt_interreflection_options {
  /* F_i = 1 / (T^-1)_ii, exact for flat patches, in place of F = diag(T), which counts light that came back to its cell
   * (T_ii = F_i (1 + (A^2)_ii + ...)) as direct. Takes an inverse by LAPACK for each channel. */
  bool exact_first_bounce;
  double tolerance;   /* relative residual of every solve with T, > 0; 0 means 1e-9 */
  const char *method; /* of the solves: one of clt_method_name that is not "bounded"; NULL: pcg or gmres */
} clt_interreflection_options;

typedef struct clt_interreflection_info {
  int width, height, channels;
  size_t cells;
  bool exact_first_bounce;
  char method[24]; /* of the solves: "pcg" where T is reciprocal, else "gmres", where none was asked for */
  /* The share, of the worst channel, by which a checkerboard z of single cells loses contrast in S: -median of
   * z_i (R z)_i. Light that bounces between surfaces is smooth from cell to cell and leaves it at 0; light that spreads
   * to the cells beside its own (subsurface, defocus, a misplaced grid) does not. */
  double spread;
  double reciprocity; /* the worst channel's defect, of the certificate */
  bool inexact;       /* A is not that of flat diffuse patches: spread or reciprocity is above its limit */
  char why[200];      /* in one sentence; empty where it is not inexact */
} clt_interreflection_info;

/* options may be NULL. transport and certificate outlive it. CLT_BAD_INPUT where rows != cols, where options are out of
 * range, and for an exact first bounce of more than CLT_EXACT_CELLS_MAX lit cells or of a T that has no inverse. */
CLT_PUBLIC clt_status clt_interreflection_create(const clt_transport *transport, const clt_certificate *certificate,
                                                 const clt_interreflection_options *options, clt_interreflection **out,
                                                 clt_error *error);
CLT_PUBLIC void clt_interreflection_destroy(clt_interreflection *interreflection); /* accepts NULL */
CLT_PUBLIC clt_interreflection_info clt_interreflection_describe(const clt_interreflection *interreflection);
/* F of a channel, cells values, 0 at dark cells. */
CLT_PUBLIC const double *clt_interreflection_first_bounce(const clt_interreflection *interreflection, int channel);

/* next = A light: one more bounce (one solve with T). Of light the lit cells count. residual (may be NULL): ||T y -
 * light|| / ||light|| over lit cells, of the y that stands for T^-1 light. next and light may be the same array. */
CLT_PUBLIC clt_status clt_interreflection_apply(clt_interreflection *interreflection, const double *light, double *next,
                                                double *residual, clt_error *error);

/* One bounce among those that make up a picture. */
typedef struct clt_bounce_figures {
  double share;    /* sum over cells and channels, of that of the picture */
  double negative; /* sum of the values below 0, of the sum of all magnitudes: noise, or an A that is none */
  double residual; /* of the solve that gave it; 0 for the direct light of a drive */
} clt_bounce_figures;

/* A picture T x taken apart: picture = light[0] + ... + light[count] + rest. */
typedef struct clt_bounces {
  int count; /* bounces after the direct light */
  int channels;
  size_t cells;
  double *light;               /* light[(k * channels + c) * cells + i]: k = 0 the direct light F x, then A^k F x */
  double *rest;                /* R A^count F x: every later bounce, by one product with T */
  double *picture;             /* T x of a drive that is 0 at dark cells, or the picture that was given */
  clt_bounce_figures *figures; /* count + 1 */
  double rest_share;
  double sum_error; /* ||light[0] + ... + rest - picture|| / ||picture|| over lit cells: the solves' residuals added */
} clt_bounces;

/* Takes T drive apart into direct light and count bounces (0..CLT_BOUNCES_MAX). b_(k+1) = A b_k is taken from b_k
 * itself: its error is relative to b_k, where eq. 51 (l_d - S^-1 of the partial sum) has that of the whole picture in
 * every bounce. out is initialised here. */
CLT_PUBLIC clt_status clt_bounces_of_drive(clt_interreflection *interreflection, const double *drive, int count,
                                           clt_bounces *out, clt_error *error);
/* The same for an observed picture (radiance less black), whose drive T^-1 picture is solved for first. */
CLT_PUBLIC clt_status clt_bounces_of_picture(clt_interreflection *interreflection, const double *picture, int count,
                                             clt_bounces *out, clt_error *error);
CLT_PUBLIC void clt_bounces_finish(clt_bounces *bounces); /* accepts a zeroed one and NULL */

/* How far eq. 51 is from given bounces of the same drive: difference[k] = ||l_d - S^-1 (b_0 + ... + b_(k-1)) - b_k|| /
 * ||b_k|| over lit cells, k = 1..count, S^-1 by a solve of the interreflection's tolerance; difference[0] = 0; infinite
 * where b_k is 0. count + 1 values. */
CLT_PUBLIC clt_status clt_bounces_compare_sums(clt_interreflection *interreflection, const clt_bounces *bounces,
                                               double *difference, clt_error *error);

/* The inverse bounce operators of Seitz et al. 2005, C^1 = F T^-1 = S^-1. `cancel` takes the direct light and the
 * bounces before the n-th out of a picture: out = (I - C^1)^n picture = A^n picture (n = 1 leaves what bounced). `keep`
 * leaves the n-th alone: out = C^n picture = C^1 (I - C^1)^(n-1) picture (n = 1 the direct light). n = 1..64; picture
 * and out may be the same array. */
CLT_PUBLIC clt_status clt_bounces_cancel(clt_interreflection *interreflection, const double *picture, int n,
                                         double *out, clt_error *error);
CLT_PUBLIC clt_status clt_bounces_keep(clt_interreflection *interreflection, const double *picture, int n, double *out,
                                       clt_error *error);

/* How direct and global light are told apart by what a fine pattern does to them. */
typedef struct clt_separation_options {
  /* Side of the checkerboard's squares in cells, 1..16: larger than what blurs the picture, smaller than what changes
   * in the global light. 0: 2 and 4 are observed, and 2 is taken where its contrast is that of 4. */
  int square;
  int step;     /* the pattern is shifted by this many cells at a time; a divisor of square; 0: half of it, or 1 */
  int repeats;  /* observations of each pattern, 1..64; 0 means 1 */
  double level; /* drive of the squares that are on, above 0..1; 0 means 1 */
  /* Called after every observation; returning false cancels (CLT_CANCELLED). May be NULL. */
  bool (*progress)(void *context, long done, long total);
  void *context;
} clt_separation_options;

/* Light under a full drive (1 everywhere) as direct + global, radiance less black. */
typedef struct clt_separation {
  clt_image direct, global;
  clt_image direct_deviation, global_deviation; /* standard deviations by the camera's noise; infinite: not seen */
  int square;                                   /* the squares that the light comes from */
  double contrast; /* median direct light by squares of 2 over that by 4, where both were observed; else 0 */
  double active;   /* mean share of cells that are on in a pattern */
  long patterns;   /* observed, repeats counted */
  size_t unseen;   /* cells (all channels) without a valid observation; 0 in both pictures */
  /* ||direct + global - (flood - black)|| / ||flood - black|| of one more observation with every cell on, and what of
   * it the noise explains. The patterns come with their complements, so that more than noise says that light did not
   * add up (a wrong response curve, a lamp that drifts), not that global light is rough. */
  double closure, closure_noise;
} clt_separation;

/* Observes black, a flood and (2 square / step) (square / step) shifted checkerboards through the rig (Nayar et al.
 * 2006). Of each cell the patterns count in whose squares it lies (square - step) / 2 cells or more from the border:
 * the on ones give direct + a global, the off ones a global, a the active share. Which is which is known, so that means
 * stand for the paper's maximum and minimum, which noise would bias. The projector's black is in the black that is
 * taken off. out is initialised here. options may be NULL. */
CLT_PUBLIC clt_status clt_separate(clt_rig *rig, const clt_separation_options *options, clt_separation *out,
                                   clt_error *error);
CLT_PUBLIC void clt_separation_finish(clt_separation *separation); /* accepts a zeroed one and NULL */

/* The dual photograph T' light: the room lit from the camera with `light` (its grid the camera's), as the projector
 * sees it, by Helmholtz's reciprocity (Sen et al. 2005). seen is initialised here. Needs rows = cols. */
CLT_PUBLIC clt_status clt_dual_photograph(const clt_transport *transport, const clt_image *light, clt_image *seen,
                                          clt_error *error);

/* What became of the reflectance: ratio_i = K_new / K_old = l_i / (F_i x_i + (A l)_i), from one photograph l of the
 * repainted room (radiance less its own black) under a known drive x: one solve with T as it was measured before. Exact
 * where A_ii = 0 and F is exact. A cell where less than 1e-3 of the 90th percentile of F_i x_i + (A l)_i arrives, or
 * that is dark, is not determined: its ratio is 1. *undetermined (may be NULL) counts them. */
CLT_PUBLIC clt_status clt_repaint_ratio(clt_interreflection *interreflection, const double *drive,
                                        const double *picture, double *ratio, size_t *undetermined, clt_error *error);

/* The transport of the repainted room, T_new = (I - D A)^-1 D F with D = diag(ratio), through products with T. */
typedef struct clt_repainted clt_repainted;
/* ratio: finite, >= 0; that of dark cells is not used. interreflection outlives it. */
CLT_PUBLIC clt_status clt_repainted_create(clt_interreflection *interreflection, const double *ratio,
                                           clt_repainted **out, clt_error *error);
CLT_PUBLIC void clt_repainted_destroy(clt_repainted *repainted); /* accepts NULL */
/* light = T_new drive. With l = S v it solves ((I - D) S + D) v = D F x by GMRES to the interreflection's tolerance, no
 * solve within a solve. CLT_FAILED where that does not converge or light comes out negative: the surfaces would reflect
 * more than arrives. */
CLT_PUBLIC clt_status clt_repainted_apply(clt_repainted *repainted, const double *drive, double *light,
                                          clt_error *error);

#ifdef __cplusplus
}
#endif
#endif
