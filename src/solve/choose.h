/* Which method serves a transport, and which one takes over where it breaks. */
#ifndef CLT_SOLVE_CHOOSE_H
#define CLT_SOLVE_CHOOSE_H

#include "solve/method.h"

/* What `auto` runs first and what it expects of it, and of the next best where there is one (else NULL). */
typedef struct clt_choice {
  const clt_method *method, *next;
  clt_forecast expected, next_expected;
} clt_choice;
/* Of the methods that the certificate proves to converge, the fastest that is expected to reach the tolerance of the
 * options (checked ones) by the deadline, else the one that is expected to come nearest. The Krylov method that the
 * reciprocity defect allows is left only for one that saves a tenth of the time. */
void clt_choose_first(const clt_certificate *certificate, const clt_transport_info *info,
                      const clt_solve_options *options, clt_choice *out);
/* What takes over from a method that broke on the system. */
const clt_method *clt_choose_next(const clt_method *broken, const clt_system *system);
/* The last resort, which never breaks: gmres, or bounded where rows != cols. */
const clt_method *clt_choose_last(const clt_system *system);
/* The method of that name, or CLT_BAD_INPUT with the names that there are. */
clt_status clt_choose_named(const char *name, const clt_method **out, clt_error *error);
/* CLT_BAD_INPUT with the reason where the certificate shows that the method cannot serve. */
clt_status clt_choose_check(const clt_method *method, const clt_certificate *certificate,
                            const clt_transport_info *info, clt_error *error);

#endif
