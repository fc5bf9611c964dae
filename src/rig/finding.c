#include "rig/finding.h"

#include <stdarg.h>
#include <stdio.h>

void clt_findings_add(clt_findings *findings, bool serious, const char *format, ...) {
  if (findings->count == CLT_FINDINGS_MAX) {
    return;
  }
  clt_finding *finding = &findings->item[findings->count++];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(finding->text, sizeof finding->text, format, arguments);
  va_end(arguments);
  finding->serious = serious;
}
