/* The pages that commands leave to be read: one look for all, and everything a page shows inside it. */
#ifndef CLT_BASE_PAGE_H
#define CLT_BASE_PAGE_H

#include <stdio.h>

#include "counterlight/status.h"

/* Everything before the page's own content: head, style (light and dark), the opening of the body. */
void clt_page_begin(FILE *page, const char *title);
void clt_page_end(FILE *page);

/* Writes text with &, <, > and quotes escaped. */
void clt_page_text(FILE *page, const char *text);
/* Writes the file at path as a base64 data URI of an image of a type ("png", "svg+xml"). */
clt_status clt_page_embed(FILE *page, const char *path, const char *type, clt_error *error);

#endif
