#include "sim/ply_file.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINE = 512 };

/* What follows the header: a line for each record in a text, else at least so many bytes. */
typedef struct promise {
  bool text;
  double count; /* of the element whose properties are being read */
  double records, bytes;
} promise;

static double size_of_type(const char *type) {
  static const struct {
    const char *name;
    double size;
  } types[] = {{"char", 1},  {"uchar", 1},   {"int8", 1},   {"uint8", 1},  {"short", 2}, {"ushort", 2},
               {"int16", 2}, {"uint16", 2},  {"int", 4},    {"uint", 4},   {"int32", 4}, {"uint32", 4},
               {"float", 4}, {"float32", 4}, {"double", 8}, {"float64", 8}};
  for (size_t k = 0; k < sizeof types / sizeof types[0]; k++) {
    if (strcmp(types[k].name, type) == 0) {
      return types[k].size;
    }
  }
  return 0.0;
}

static void read_line(const char *line, promise *promised) {
  char first[32], second[32];
  if (sscanf(line, "format %31s", first) == 1) {
    promised->text = strcmp(first, "ascii") == 0;
  } else if (sscanf(line, "element %*s %31s", first) == 1) {
    promised->count = strtod(first, NULL);
    promised->records += promised->count;
  } else if (sscanf(line, "property list %31s", first) == 1) { /* a list may be empty, but has a length */
    promised->bytes += promised->count * size_of_type(first);
  } else if (sscanf(line, "property %31s %31s", first, second) == 2) {
    promised->bytes += promised->count * size_of_type(first);
  }
}

/* False where the header does not end. */
static bool read_header(FILE *file, promise *promised) {
  char line[LINE];
  while (fgets(line, sizeof line, file) != NULL) {
    if (strncmp(line, "end_header", 10) == 0) {
      return true;
    }
    read_line(line, promised);
  }
  return false;
}

static bool holds_bytes(FILE *file, double wanted) {
  long here = ftell(file);
  return here >= 0 && fseek(file, 0, SEEK_END) == 0 && (double)(ftell(file) - here) >= wanted;
}

/* Lines with something in them. One that the file ends in may lack digits, and does not count. */
static bool holds_lines(FILE *file, double wanted) {
  char block[4096];
  double lines = 0.0;
  bool written = false;
  for (size_t read; lines < wanted && (read = fread(block, 1, sizeof block, file)) > 0;) {
    for (size_t k = 0; k < read; k++) {
      if (block[k] == '\n' || block[k] == '\r') {
        lines += written;
        written = false;
      } else {
        written = written || (block[k] != ' ' && block[k] != '\t');
      }
    }
  }
  return lines >= wanted;
}

static clt_status check(FILE *file, clt_error *error) {
  char line[LINE];
  promise promised = {.text = false};
  if (fgets(line, sizeof line, file) == NULL || strncmp(line, "ply", 3) != 0) {
    return CLT_OK;
  }
  if (!read_header(file, &promised)) {
    return clt_fail(error, CLT_BAD_INPUT, "its header does not end; write the file again");
  }
  bool whole = promised.text ? holds_lines(file, promised.records) : holds_bytes(file, promised.bytes);
  if (!whole) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "ends before the %.0f vertices, faces and others that its header counts have ended; write it again",
                    promised.records);
  }
  return CLT_OK;
}

clt_status clt_ply_check(const char *path, clt_error *error) {
  FILE *file = fopen(path, "rb");
  if (file == NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "cannot be opened; check its name");
  }
  clt_status status = check(file, error);
  fclose(file);
  return status;
}
