/* What `counterlight doctor` finds: each part of the machine is looked at by one function, which adds findings, and
 * what it saw, to one JSON document; the command prints that, or the findings as text. */
#ifndef CLT_CLI_DOCTOR_H
#define CLT_CLI_DOCTOR_H

#include <jansson.h>
#include <stdbool.h>

#include "counterlight/station.h"

/* Only a problem makes the command fail: what is configured will not work. */
typedef enum doctor_level { DOCTOR_GOOD, DOCTOR_NOTE, DOCTOR_WARNING, DOCTOR_PROBLEM } doctor_level;

typedef struct doctor {
  json_t *document; /* findings, monitors, cameras, ... */
  json_t *findings; /* in the document: [{level, area, what, advice}] */
  const char *area; /* of what is being looked at */
  const char *path; /* of the configuration; NULL: none was given */
  bool configured;  /* the configuration could be read */
  clt_station_config config;
} doctor;

/* Adds a finding to the area that is being looked at; advice may be NULL. */
void doctor_find(doctor *self, doctor_level level, const char *advice, const char *format, ...) CLT_PRINTF(4, 5);
/* DOCTOR_PROBLEM where the configuration asks for this driver, else less. */
doctor_level doctor_level_of(const doctor *self, const char *driver, doctor_level less);
/* Whether the configuration names this driver for its camera or projector. */
bool doctor_uses(const doctor *self, const char *driver);

void doctor_look_at_configuration(doctor *self);
void doctor_look_at_projector(doctor *self);
void doctor_look_at_v4l2(doctor *self);
void doctor_look_at_libcamera(doctor *self);
void doctor_look_at_access(doctor *self);
void doctor_look_at_service(doctor *self);
void doctor_look_at_machine(doctor *self);

#endif
