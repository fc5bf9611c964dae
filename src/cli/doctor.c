/* counterlight doctor: what this machine has, what it lacks, and what to do about it. */
#include "cli/doctor.h"

#include <stdarg.h>
#include <string.h>

#include "cli/command.h"

static const cli_option options[] = {
    {"config", 0, "FILE", "the configuration that is to work here"},
    {NULL, 0, NULL, NULL},
};

static const char *const level_names[] = {"good", "note", "warning", "problem"};
enum { LEVELS = sizeof level_names / sizeof level_names[0] };

/* In the order in which they are looked at and printed. */
static const struct {
  const char *area;
  void (*look)(doctor *self);
} areas[] = {{"configuration", doctor_look_at_configuration},
             {"projector", doctor_look_at_projector},
             {"camera", doctor_look_at_v4l2},
             {"camera", doctor_look_at_libcamera},
             {"access", doctor_look_at_access},
             {"service", doctor_look_at_service},
             {"machine", doctor_look_at_machine}};
enum { AREAS = sizeof areas / sizeof areas[0] };

/* Names of devices are bytes that no standard binds; JSON takes UTF-8 only. */
static void make_text(char *bytes) {
  json_t *text = json_string(bytes);
  for (char *c = bytes; text == NULL && *c != '\0'; c++) {
    *c = (unsigned char)*c < 0x80 ? *c : '?';
  }
  json_decref(text);
}

void doctor_find(doctor *self, doctor_level level, const char *advice, const char *format, ...) {
  char what[2 * CLT_MESSAGE_MAX];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(what, sizeof what, format, arguments);
  va_end(arguments);
  make_text(what);
  json_array_append_new(self->findings, json_pack("{s:s, s:s, s:s, s:s?}", "level", level_names[level], "area",
                                                  self->area, "what", what, "advice", advice));
}

bool doctor_uses(const doctor *self, const char *driver) {
  return self->configured &&
         (strcmp(self->config.camera.driver, driver) == 0 || strcmp(self->config.projector.driver, driver) == 0);
}

doctor_level doctor_level_of(const doctor *self, const char *driver, doctor_level less) {
  return doctor_uses(self, driver) ? DOCTOR_PROBLEM : less;
}

static int count_level(const doctor *self, doctor_level level) {
  int count = 0;
  size_t k;
  json_t *finding;
  json_array_foreach(self->findings, k, finding) {
    count += strcmp(json_string_value(json_object_get(finding, "level")), level_names[level]) == 0;
  }
  return count;
}

static void print_findings(const doctor *self) {
  const char *area = "";
  size_t k;
  json_t *finding;
  json_array_foreach(self->findings, k, finding) {
    const char *advice = json_string_value(json_object_get(finding, "advice"));
    const char *at = json_string_value(json_object_get(finding, "area"));
    if (strcmp(at, area) != 0) {
      printf("%s%s\n", k > 0 ? "\n" : "", at);
      area = at;
    }
    printf("  %-8s %s\n", json_string_value(json_object_get(finding, "level")),
           json_string_value(json_object_get(finding, "what")));
    if (advice != NULL) {
      printf("           -> %s\n", advice);
    }
  }
  printf("\n%d good, %d to note, %d warnings, %d problems\n", count_level(self, DOCTOR_GOOD),
         count_level(self, DOCTOR_NOTE), count_level(self, DOCTOR_WARNING), count_level(self, DOCTOR_PROBLEM));
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  doctor self = {.document = json_object(), .path = cli_value(command, arguments, "config")};
  self.findings = json_array();
  json_object_set_new(self.document, "findings", self.findings);
  for (int k = 0; k < AREAS; k++) {
    self.area = areas[k].area;
    areas[k].look(&self);
  }
  int code = count_level(&self, DOCTOR_PROBLEM) > 0 ? CLI_FAILED : CLI_DONE;
  if (arguments->json) {
    json_t *counts = json_object();
    for (int level = 0; level < LEVELS; level++) {
      json_object_set_new(counts, level_names[level], json_integer(count_level(&self, (doctor_level)level)));
    }
    json_object_set_new(self.document, "counts", counts);
    int printed = cli_print_json(self.document);
    return printed != CLI_DONE ? printed : code;
  }
  if (!arguments->quiet) {
    print_findings(&self);
  }
  json_decref(self.document);
  return code;
}

static const char notes[] =
    "Nothing is changed, and no camera is taken. Exit code 0 where nothing stands in the way of the configuration (a\n"
    "warning or a note may still be worth reading), 1 where something does. Without --config nothing is needed, so "
    "that\n"
    "little is a problem.\n";

const cli_command cli_command_doctor = {
    .name = "doctor",
    .synopsis = "[--config FILE]",
    .summary = "say what this machine has and lacks, and what to do",
    .options = options,
    .run = run,
    .notes = notes,
};
