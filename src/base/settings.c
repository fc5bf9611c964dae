#include "base/settings.h"

#include <errno.h>
#include <libconfig.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

struct clt_settings {
  config_t config;
  char path[CLT_PATH_MAX];
  clt_error problem;
};

/* Hooks mark what was read, and what was left to another reader; a key without one is unknown. */
static char was_read[1], was_left[1];

clt_status clt_settings_open(const char *path, clt_settings **out, clt_error *error) {
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s: cannot be read: %s", path, strerror(errno));
  }
  clt_settings *settings = clt_alloc(1, sizeof *settings);
  if (settings == NULL) {
    fclose(file);
    return clt_fail(error, CLT_FAILED, "%s: out of memory", path);
  }
  snprintf(settings->path, sizeof settings->path, "%s", path);
  config_init(&settings->config);
  int parsed = config_read(&settings->config, file);
  fclose(file);
  if (!parsed) {
    clt_fail(error, CLT_BAD_INPUT, "%s:%d: %s", path, config_error_line(&settings->config),
             config_error_text(&settings->config));
    clt_settings_close(settings);
    return CLT_BAD_INPUT;
  }
  *out = settings;
  return CLT_OK;
}

void clt_settings_close(clt_settings *settings) {
  if (settings != NULL) {
    config_destroy(&settings->config);
    free(settings);
  }
}

clt_section clt_settings_root(clt_settings *settings) {
  return (clt_section){settings, config_root_setting(&settings->config)};
}

static void keep_problem(clt_settings *settings, const config_setting_t *at, const char *key, const char *text) {
  if (settings->problem.status == CLT_OK) {
    int line = at != NULL ? (int)config_setting_source_line(at) : 0;
    clt_fail(&settings->problem, CLT_BAD_INPUT, "%s:%d: %s%s%s", settings->path, line, key != NULL ? key : "",
             key != NULL ? ": " : "", text);
  }
}

void clt_section_fail(clt_section section, const char *key, const char *format, ...) {
  char text[CLT_MESSAGE_MAX / 2];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  config_setting_t *at = section.group;
  config_setting_t *member = key != NULL && at != NULL ? config_setting_get_member(at, key) : NULL;
  keep_problem(section.settings, member != NULL ? member : at, key, text);
}

/* The first key below a group that nobody read, or NULL. */
static const config_setting_t *first_unread(const config_setting_t *group) {
  for (int i = 0; i < config_setting_length(group); i++) {
    config_setting_t *child = config_setting_get_elem(group, (unsigned)i);
    if (config_setting_name(child) != NULL && config_setting_get_hook(child) == NULL) {
      return child;
    }
    int type = config_setting_type(child);
    bool left = config_setting_get_hook(child) == was_left;
    const config_setting_t *below =
        !left && (type == CONFIG_TYPE_GROUP || type == CONFIG_TYPE_LIST) ? first_unread(child) : NULL;
    if (below != NULL) {
      return below;
    }
  }
  return NULL;
}

clt_status clt_settings_finish(clt_settings *settings, clt_error *error) {
  const config_setting_t *unread = first_unread(config_root_setting(&settings->config));
  if (unread != NULL) {
    keep_problem(settings, unread, config_setting_name(unread),
                 "is not a known key here; check its spelling and place");
  }
  if (settings->problem.status != CLT_OK && error != NULL) {
    *error = settings->problem;
  }
  return settings->problem.status;
}

/* The member, marked as read; NULL where it is absent. */
static config_setting_t *find(clt_section section, const char *key) {
  config_setting_t *member = section.group != NULL ? config_setting_get_member(section.group, key) : NULL;
  if (member != NULL) {
    config_setting_set_hook(member, was_read);
  }
  return member;
}

bool clt_section_has(clt_section section, const char *key) {
  return section.group != NULL && config_setting_get_member(section.group, key) != NULL;
}

void clt_section_leave(clt_section section, const char *key) {
  config_setting_t *member = find(section, key);
  if (member != NULL) {
    config_setting_set_hook(member, was_left);
  }
}

void clt_section_leave_others(clt_section section, const char *key) {
  int count = section.group != NULL ? config_setting_length(section.group) : 0;
  for (int i = 0; i < count; i++) {
    const char *name = config_setting_name(config_setting_get_elem(section.group, (unsigned)i));
    if (strcmp(name, key) != 0) {
      clt_section_leave(section, name);
    }
  }
}

clt_section clt_section_group(clt_section section, const char *key) {
  config_setting_t *member = find(section, key);
  if (member != NULL && !config_setting_is_group(member)) {
    clt_section_fail(section, key, "must be a group { ... }");
    member = NULL;
  }
  return (clt_section){section.settings, member};
}

int clt_section_count(clt_section section, const char *key) {
  config_setting_t *member = find(section, key);
  if (member == NULL) {
    return 0;
  }
  int count = config_setting_length(member);
  for (int i = 0; i < count; i++) {
    if (!config_setting_is_list(member) || !config_setting_is_group(config_setting_get_elem(member, (unsigned)i))) {
      clt_section_fail(section, key, "must be a list of groups ( { ... }, { ... } )");
      return 0;
    }
  }
  return count;
}

clt_section clt_section_item(clt_section section, const char *key, int index) {
  config_setting_t *member = find(section, key);
  return (clt_section){section.settings, member != NULL ? config_setting_get_elem(member, (unsigned)index) : NULL};
}

static bool number_of(const config_setting_t *setting, double *value) {
  switch (config_setting_type(setting)) {
  case CONFIG_TYPE_INT:
    *value = config_setting_get_int(setting);
    return true;
  case CONFIG_TYPE_INT64:
    *value = (double)config_setting_get_int64(setting);
    return true;
  case CONFIG_TYPE_FLOAT:
    *value = config_setting_get_float(setting);
    return true;
  default:
    return false;
  }
}

static bool checked_number(clt_section section, const char *key, const config_setting_t *setting, double low,
                           double high, double *value) {
  if (!number_of(setting, value)) {
    clt_section_fail(section, key, "must be a number from %g to %g", low, high);
    return false;
  }
  if (!(*value >= low && *value <= high)) {
    clt_section_fail(section, key, "is %g; legal is %g to %g", *value, low, high);
    return false;
  }
  return true;
}

double clt_read_number(clt_section section, const char *key, double fallback, double low, double high) {
  const config_setting_t *member = find(section, key);
  double value = fallback;
  return member != NULL && checked_number(section, key, member, low, high, &value) ? value : fallback;
}

int clt_read_integer(clt_section section, const char *key, int fallback, int low, int high) {
  double value = clt_read_number(section, key, fallback, low, high);
  if (value != floor(value)) {
    clt_section_fail(section, key, "is %g; it must be a whole number from %d to %d", value, low, high);
    return fallback;
  }
  return (int)value;
}

bool clt_read_flag(clt_section section, const char *key, bool fallback) {
  const config_setting_t *member = find(section, key);
  if (member == NULL) {
    return fallback;
  }
  if (config_setting_type(member) != CONFIG_TYPE_BOOL) {
    clt_section_fail(section, key, "must be true or false");
    return fallback;
  }
  return config_setting_get_bool(member) != 0;
}

const char *clt_read_text(clt_section section, const char *key, const char *fallback, size_t most) {
  const config_setting_t *member = find(section, key);
  if (member == NULL) {
    return fallback;
  }
  const char *text = config_setting_get_string(member);
  if (text == NULL || strlen(text) > most) {
    clt_section_fail(section, key, "must be a text \"...\" of at most %zu characters", most);
    return fallback;
  }
  return text;
}

int clt_read_choice(clt_section section, const char *key, int fallback, const char *const *names) {
  const char *text = clt_read_text(section, key, NULL, 64);
  if (text == NULL) {
    return fallback;
  }
  char list[160] = "";
  for (int i = 0; names[i] != NULL; i++) {
    if (strcmp(names[i], text) == 0) {
      return i;
    }
    size_t used = strlen(list);
    snprintf(list + used, sizeof list - used, "%s\"%s\"", i > 0 ? ", " : "", names[i]);
  }
  clt_section_fail(section, key, "is \"%s\"; legal is %s", text, list);
  return fallback;
}

int clt_read_numbers(clt_section section, const char *key, double *values, int fewest, int most, double low,
                     double high) {
  config_setting_t *member = find(section, key);
  if (member == NULL) {
    return 0;
  }
  bool aggregate = config_setting_is_array(member) || config_setting_is_list(member);
  int count = aggregate ? config_setting_length(member) : 1;
  if (count < fewest || count > most) {
    clt_section_fail(section, key, "has %d values; legal is %d to %d", count, fewest, most);
    return 0;
  }
  for (int i = 0; i < count; i++) {
    const config_setting_t *element = aggregate ? config_setting_get_elem(member, (unsigned)i) : member;
    if (!checked_number(section, key, element, low, high, &values[i])) {
      return 0;
    }
  }
  return count;
}
