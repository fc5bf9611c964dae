#include "acquire/choose.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const clt_scheme *const schemes[] = {&clt_scheme_brute, &clt_scheme_hadamard, &clt_scheme_hierarchical,
                                            &clt_scheme_blocks};
enum { SCHEMES = sizeof schemes / sizeof schemes[0] };

/* What is known of a scheme before it runs. */
typedef struct forecast {
  const clt_scheme *scheme;
  long patterns;  /* all of them */
  double error;   /* expected */
  double seconds; /* 0 where time does not count */
} forecast;

static forecast forecast_scheme(const clt_session *session, const clt_scheme *scheme, double each) {
  const int repeats = session->options.repeats > 0 ? session->options.repeats : scheme->repeats(session->cells);
  const long patterns = 2L * repeats + scheme->patterns(session) + session->options.checks;
  return (forecast){scheme, patterns, scheme->error(session), each * (double)patterns};
}

/* Of two that reach the wanted error the one of fewer patterns, else the one of less error; one that time allows before
 * one that it does not; of those the one that stops in time. */
static bool is_better(const clt_session *session, const forecast *a, const forecast *b) {
  const double wanted = session->options.error, allowed = session->options.seconds;
  const bool a_fits = !(allowed > 0) || a->seconds <= allowed, b_fits = !(allowed > 0) || b->seconds <= allowed;
  const bool a_reaches = a->error <= wanted, b_reaches = b->error <= wanted;
  if (a_fits != b_fits) {
    return a_fits;
  }
  if (!a_fits && a->scheme->stops != b->scheme->stops) {
    return a->scheme->stops;
  }
  if (!a_fits || (a_reaches && b_reaches)) {
    return a->patterns < b->patterns;
  }
  return a->error < b->error;
}

static void write_plan(clt_session *session, const forecast *chosen) {
  const double wanted = session->options.error, allowed = session->options.seconds;
  char time[48] = "";
  if (allowed > 0) {
    snprintf(time, sizeof time, ", %.0f s of %.0f s", chosen->seconds, allowed);
  }
  snprintf(session->plan, sizeof session->plan, "%s: about %ld patterns%s; %.2g %% expected, %.2g %% wanted%s",
           chosen->scheme->name, chosen->patterns, time, 100 * chosen->error, 100 * wanted,
           !(allowed > 0 && chosen->seconds > allowed) ? ""
           : chosen->scheme->stops                     ? "; stops at that time"
                                                       : "; too long");
}

/* Seconds that a pattern takes. */
static clt_status time_pattern(clt_session *session, double *each, clt_error *error) {
  *each = 0;
  if (!(session->options.seconds > 0)) {
    return CLT_OK;
  }
  clt_session_fill(session, 0);
  clt_status status = clt_session_observe(session, "timing", error);
  *each = session->progress.seconds / (double)session->progress.done;
  return status;
}

static clt_status choose(clt_session *session, const clt_scheme **out, clt_error *error) {
  double each = 0;
  clt_status status = time_pattern(session, &each, error);
  if (status != CLT_OK) {
    return status;
  }
  forecast best = forecast_scheme(session, schemes[0], each);
  for (size_t i = 1; i < SCHEMES; i++) {
    const forecast next = forecast_scheme(session, schemes[i], each);
    if (is_better(session, &next, &best)) {
      best = next;
    }
  }
  write_plan(session, &best);
  *out = best.scheme;
  return CLT_OK;
}

clt_status clt_choose_scheme(clt_session *session, const clt_scheme **out, clt_error *error) {
  const char *name = session->options.scheme;
  if (name == NULL || strcmp(name, "auto") == 0) {
    return choose(session, out, error);
  }
  char names[96] = "auto";
  for (size_t i = 0; i < SCHEMES; i++) {
    if (strcmp(schemes[i]->name, name) == 0) {
      *out = schemes[i];
      snprintf(session->plan, sizeof session->plan, "%s: asked for", name);
      return CLT_OK;
    }
    size_t used = strlen(names);
    snprintf(names + used, sizeof names - used, ", %s", schemes[i]->name);
  }
  return clt_fail(error, CLT_BAD_INPUT, "\"%.40s\" is no acquisition scheme; there are %s", name, names);
}
