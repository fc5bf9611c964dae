#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "base/clock.h"
#include "solve/method.h"

static void append(clt_run *run, double norm) {
  run->norm = norm;
  if (run->curve_count < CLT_CURVE_MAX) {
    run->curve[run->curve_count++] = norm;
  }
}

double clt_run_noise(const clt_run *run, const clt_system *system) {
  static const double SAFETY = 1.05;
  double left = run->noise.observed;
  size_t cols = system->cols / (size_t)system->channels;
  for (int c = 0; c < system->channels; c++) {
    double squares = 0;
    for (size_t j = (size_t)c * cols; j < (size_t)(c + 1) * cols && run->noise.entries[c] > 0; j++) {
      double drive = system->light[j] * system->scale[j];
      squares += drive * drive;
    }
    left += run->noise.entries[c] * squares;
  }
  return SAFETY * sqrt(left);
}

double clt_run_target(const clt_run *run, const clt_system *system) {
  return fmax(run->tolerance * system->wanted_least, clt_run_noise(run, system));
}

void clt_run_open(clt_run *run, double norm) {
  run->curve_count = 0;
  append(run, norm);
}

void clt_run_count(clt_run *run, double norm) {
  run->iterations++;
  append(run, norm);
}

bool clt_run_may_go_on(const clt_run *run) {
  return run->iterations < run->iteration_limit &&
         (run->deadline_s <= 0 || clt_clock_since(run->start_ns) < run->deadline_s);
}

void clt_run_note(clt_run *run, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(run->note, sizeof run->note, format, arguments);
  va_end(arguments);
}
