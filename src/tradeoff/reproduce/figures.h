/* What the parts of the reproduction share: one file for each figure, one entry in the table of reproduce.c. */
#ifndef CLT_REPRODUCE_FIGURES_H
#define CLT_REPRODUCE_FIGURES_H

#include "counterlight/image.h"
#include "counterlight/reproduce.h"
#include "tradeoff/chart.h"

enum { CLT_FIGURE_FILES = 6 };
/* A picture or chart that a part leaves. */
typedef struct clt_figure_file {
  const char *name;    /* without folder */
  const char *caption; /* what it shows, in a sentence */
  bool wide;           /* takes the page's whole width */
} clt_figure_file;

/* A part: what it computes and how. It writes its files into options->folder and adds its rows. */
typedef struct clt_figure {
  const char *name; /* "Fig. 8", in the page and in progress */
  const char *caption;
  clt_figure_file files[CLT_FIGURE_FILES]; /* ended by one without name where there are fewer */
  clt_status (*compute)(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error);
} clt_figure;

extern const clt_figure clt_figure_coefficients, clt_figure_cornell, clt_figure_convergence, clt_figure_scenes,
    clt_figure_ladder, clt_figure_montecarlo, clt_figure_bounces;

/* Tells a step of the part that is computed ("Fig. 10, N = 5120"); CLT_CANCELLED where the caller asks to stop. */
clt_status clt_figure_step(const clt_reproduce_options *options, clt_error *error, const char *format, ...)
    CLT_PRINTF(3, 4);

/* Adds a row; the text of ours is formatted. */
void clt_reproduced_add(clt_reproduction *out, const char *name, const char *report, bool pass, const char *format, ...)
    CLT_PRINTF(5, 6);

/* Writes a picture into the folder. */
clt_status clt_figure_picture(const char *folder, const char *name, const clt_image *image, clt_error *error);

#endif
