/* Strict reading of libconfig files (configurations and scenes).
 *
 * Every key is read by its name, with its legal range; the first problem is kept and later reads return their fallback,
 * so that a reader is a plain list of keys. clt_settings_finish then reports that first problem, or a key that nobody
 * read, with file, line and what would be legal. */
#ifndef CLT_BASE_SETTINGS_H
#define CLT_BASE_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>

#include "counterlight/status.h"

typedef struct clt_settings clt_settings;

/* A group of the file. Reading from an absent one (group == NULL) gives every fallback. */
typedef struct clt_section {
  clt_settings *settings;
  void *group;
} clt_section;

/* Parses the file; CLT_BAD_INPUT with file and line where it cannot be read or its syntax is wrong. */
clt_status clt_settings_open(const char *path, clt_settings **out, clt_error *error);
void clt_settings_close(clt_settings *settings); /* accepts NULL; ends the life of every text read from it */
clt_section clt_settings_root(clt_settings *settings);
/* CLT_OK, or CLT_BAD_INPUT with the first problem or the first unknown key. */
clt_status clt_settings_finish(clt_settings *settings, clt_error *error);

bool clt_section_has(clt_section section, const char *key);
/* A group inside a group; absent where the key is. */
clt_section clt_section_group(clt_section section, const char *key);
/* The groups of a list `key = ( {...}, {...} )`. */
int clt_section_count(clt_section section, const char *key);
clt_section clt_section_item(clt_section section, const char *key, int index);
/* Leaves a key and all below it to another reader of the same file. */
void clt_section_leave(clt_section section, const char *key);
/* Leaves every key of the section but one to another reader. */
void clt_section_leave_others(clt_section section, const char *key);

double clt_read_number(clt_section section, const char *key, double fallback, double low, double high);
int clt_read_integer(clt_section section, const char *key, int fallback, int low, int high);
bool clt_read_flag(clt_section section, const char *key, bool fallback);
/* The text lives as long as the settings; at most most characters. */
const char *clt_read_text(clt_section section, const char *key, const char *fallback, size_t most);
/* Index of the text in names (ended by NULL). */
int clt_read_choice(clt_section section, const char *key, int fallback, const char *const *names);
/* An array of numbers; returns their count, 0 where the key is absent. A single number counts as an array of one. */
int clt_read_numbers(clt_section section, const char *key, double *values, int fewest, int most, double low,
                     double high);

/* Keeps a problem at a key (NULL: at the section itself) found by its reader: "scene.cfg:12: walls: ..." */
void clt_section_fail(clt_section section, const char *key, const char *format, ...) CLT_PRINTF(3, 4);

#endif
