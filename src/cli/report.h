/* report.html of the demo: one page that holds everything it shows. */
#ifndef CLT_CLI_REPORT_H
#define CLT_CLI_REPORT_H

#include <stddef.h>
#include <stdio.h>

#include "cli/demo.h"

/* Writes the page; the pictures are read back from the demo's folder. */
clt_status cli_report_write(const char *path, const demo *d, clt_error *error);

/* An inline SVG of the relative residuals (log) of count runs against their iterations. */
void cli_report_curves(FILE *page, const clt_solve_result *runs, int count);
/* An inline SVG of the error maps' colour scale from 0 to top (in units of white). */
clt_status cli_report_scale(FILE *page, double top, clt_error *error);

#endif
