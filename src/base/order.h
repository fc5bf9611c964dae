/* Numbers in ascending order. None of them may be NaN. */
#ifndef CLT_BASE_ORDER_H
#define CLT_BASE_ORDER_H

#include <stddef.h>

void clt_sort_doubles(double *values, size_t count);
void clt_sort_floats(float *values, size_t count);

#endif
