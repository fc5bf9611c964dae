/* What the parts of the bench share. */
#ifndef CLT_TRADEOFF_BENCH_H
#define CLT_TRADEOFF_BENCH_H

#include <stdint.h>

#include "counterlight/bench.h"

enum { CLT_BENCH_TURNS = 5 }; /* of every peer, from nothing and warm */

/* What drives of moving pictures differ from 0.5 by, at most: those that T can show, and those that it cannot, because
 * cells would have to give less than nothing and more than all. */
static const double CLT_BENCH_WITHIN = 0.35, CLT_BENCH_BEYOND = 0.8;

/* The picture of frame `number` under the drive (channels x cells, room) that is filled as well; 0 where that is less.
 */
void clt_bench_picture(const clt_transport *transport, int number, double swing, double *drive, double *seen,
                       float *target);
/* The median of count times, which are sorted. */
double clt_bench_median(double *times, size_t count);

clt_status clt_bench_kernels(const clt_transport *transport, const clt_certificate *certificate,
                             clt_bench_report *report, clt_error *error);
clt_status clt_bench_frames(const clt_transport *transport, const clt_certificate *certificate,
                            const clt_bench_options *options, double swing, clt_bench_frame *frame, clt_error *error);
/* The report's iteration (eq. 43) in single precision over compressed rows of as few entries (128, 256, ...) as make
 * its answer as exact as target_error by all of T, within 1.25 GiB. Fills all but the ratios. */
clt_status clt_bench_jacobi(const clt_transport *transport, const clt_certificate *certificate, double target_error,
                            clt_bench_peer *peer, clt_error *error);

/* Adds up an array, each thread its part, in as many sums as keep the processor busy: the plain read of memory that
 * products are set beside. */
uint64_t clt_bench_read(const uint64_t *words, size_t count);

#endif
