/* Colouring of conflict graphs. */
#ifndef CLT_ACQUIRE_COLOURING_H
#define CLT_ACQUIRE_COLOURING_H

#include <stddef.h>
#include <stdint.h>

#include "counterlight/status.h"

/* Colours columns so that no row holds two of one colour. Row i holds the distinct columns column[start[i]] ..
 * column[start[i + 1] - 1], each 0 <= column < columns. colour[columns] becomes 0 .. *colours - 1, or -1 for a column
 * that no row holds. Greedy, those that share rows with most others first; the conflict graph itself is never stored
 * (the column partition of sparse Jacobians: Curtis, Powell, Reid 1974; Gebremedhin, Manne, Pothen 2005). Work:
 * the sum over rows of their length squared. CLT_FAILED where memory is short. */
clt_status clt_colour_columns(size_t rows, const int64_t *start, const int32_t *column, int32_t columns,
                              int32_t *colour, int32_t *colours, clt_error *error);

#endif
