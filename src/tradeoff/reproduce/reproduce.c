/* The report, part by part. */
#include "counterlight/reproduce.h"

#include <stdarg.h>
#include <stdio.h>

#include "base/file.h"
#include "tradeoff/reproduce/figures.h"
#include "tradeoff/reproduce/page.h"

static const clt_figure *const figures[] = {&clt_figure_coefficients, &clt_figure_cornell, &clt_figure_convergence,
                                            &clt_figure_scenes,       &clt_figure_ladder,  &clt_figure_montecarlo,
                                            &clt_figure_bounces};
enum { FIGURES = sizeof figures / sizeof figures[0] };

void clt_reproduced_add(clt_reproduction *out, const char *name, const char *report, bool pass, const char *format,
                        ...) {
  if (out->count == CLT_REPRODUCED_MAX) {
    return;
  }
  clt_reproduced *row = &out->rows[out->count++];
  snprintf(row->name, sizeof row->name, "%s", name);
  snprintf(row->report, sizeof row->report, "%s", report);
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(row->ours, sizeof row->ours, format, arguments);
  va_end(arguments);
  row->pass = pass;
}

clt_status clt_figure_picture(const char *folder, const char *name, const clt_image *image, clt_error *error) {
  char path[CLT_PATH_MAX];
  clt_status status = clt_file_join(folder, name, path, error);
  return status == CLT_OK ? clt_image_write(path, NULL, image, error) : status;
}

/* A part's own steps are told as the part that they belong to. */
typedef struct place {
  const clt_reproduce_options *asked;
  int done, parts;
} place;

static bool tell(void *context, const char *step, int done, int parts) {
  const place *at = context;
  (void)done;
  (void)parts;
  return at->asked->progress(at->asked->context, step, at->done, at->parts);
}

clt_status clt_figure_step(const clt_reproduce_options *options, clt_error *error, const char *format, ...) {
  char step[64];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(step, sizeof step, format, arguments);
  va_end(arguments);
  return options->progress == NULL || options->progress(options->context, step, 0, 0)
             ? CLT_OK
             : clt_fail(error, CLT_CANCELLED, "stopped at %s", step);
}

clt_status clt_reproduce(const clt_reproduce_options *options, clt_reproduction *out, clt_error *error) {
  clt_page_part parts[FIGURES];
  clt_status status = CLT_OK;
  *out = (clt_reproduction){0};
  for (int k = 0; status == CLT_OK && k < FIGURES; k++) {
    place at = {options, k, FIGURES};
    clt_reproduce_options inside = *options;
    inside.context = &at;
    inside.progress = options->progress != NULL ? tell : NULL;
    parts[k] = (clt_page_part){.figure = figures[k], .first = out->count};
    status = clt_figure_step(&inside, error, "%s", figures[k]->name);
    if (status == CLT_OK) {
      status = figures[k]->compute(&inside, out, error);
    }
    parts[k].last = out->count;
    if (status != CLT_OK) {
      clt_fail_within(error, "%s: ", figures[k]->name);
    }
  }
  return status == CLT_OK ? clt_page_write(options->folder, parts, FIGURES, out, error) : status;
}
