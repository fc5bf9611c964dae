/* reproduce.html: the report's numbers and ours side by side, one page that holds everything it shows. */
#ifndef CLT_REPRODUCE_PAGE_H
#define CLT_REPRODUCE_PAGE_H

#include "tradeoff/reproduce/figures.h"

/* A figure and its rows, first <= k < last. */
typedef struct clt_page_part {
  const clt_figure *figure;
  int first, last;
} clt_page_part;

clt_status clt_page_write(const char *folder, const clt_page_part *parts, int count, const clt_reproduction *rows,
                          clt_error *error);

#endif
