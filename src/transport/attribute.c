#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "transport/hdf.h"

/* Opens a root attribute that holds one value. *attribute stays invalid where it is absent or empty. */
static clt_status open_attribute(const clt_hdf *hdf, const char *name, hid_t *attribute, clt_error *error) {
  *attribute = H5I_INVALID_HID;
  if (H5Aexists(hdf->file, name) <= 0) {
    return CLT_OK;
  }
  hid_t opened = H5Aopen(hdf->file, name, H5P_DEFAULT);
  if (opened < 0) {
    return clt_hdf_refuse_read(hdf, name, error);
  }
  hid_t space = H5Aget_space(opened);
  hssize_t count = H5Sget_simple_extent_npoints(space);
  H5Sclose(space);
  if (count == 1) {
    *attribute = opened;
    return CLT_OK;
  }
  H5Aclose(opened);
  return count == 0 ? CLT_OK
                    : clt_fail(error, CLT_BAD_INPUT, "%s: the attribute %s holds %lld values; write one", hdf->path,
                               name, (long long)count);
}

clt_status clt_hdf_read_number(const clt_hdf *hdf, const char *name, double *value, clt_error *error) {
  hid_t attribute;
  clt_status status = open_attribute(hdf, name, &attribute, error);
  if (attribute < 0) {
    return status;
  }
  hid_t type = H5Aget_type(attribute);
  status = clt_hdf_require_numbers(hdf, name, type, error);
  if (status == CLT_OK && H5Aread(attribute, H5T_NATIVE_DOUBLE, value) < 0) {
    status = clt_hdf_refuse_read(hdf, name, error);
  }
  H5Tclose(type);
  H5Aclose(attribute);
  return status;
}

/* Bytes of the UTF-8 character that `from` begins with (RFC 3629), 0 where it is none. */
static size_t character_length(const unsigned char *from, size_t room) {
  static const unsigned first_code[] = {0, 0, 0x80, 0x800, 0x10000};
  size_t length = from[0] < 0x80 ? 1 : from[0] >> 5 == 6 ? 2 : from[0] >> 4 == 14 ? 3 : from[0] >> 3 == 30 ? 4 : 0;
  if (length < 2 || length > room) {
    return length == 1 ? 1 : 0;
  }
  unsigned code = from[0] & (0x7fu >> length);
  for (size_t k = 1; k < length; k++) {
    if (from[k] >> 6 != 2) {
      return 0;
    }
    code = code << 6 | (from[k] & 0x3fu);
  }
  bool surrogate = code >= 0xd800 && code < 0xe000;
  return code >= first_code[length] && code <= 0x10ffff && !surrogate ? length : 0;
}

/* Copies what fits of one line of UTF-8, whole characters only; '?' stands for what is none and for control characters,
 * so that the text may go into messages and JSON. */
static void copy_text(char *text, size_t size, const char *from, size_t length) {
  const unsigned char *bytes = (const unsigned char *)from;
  size_t used = 0, step;
  length = strnlen(from, length);
  for (size_t i = 0; i < length; i += step) {
    size_t known = character_length(bytes + i, length - i);
    step = known == 0 ? 1 : known;
    if (used + step >= size) {
      break;
    }
    if (known == 0 || bytes[i] < 0x20 || bytes[i] == 0x7f) {
      text[used] = '?';
    } else {
      memcpy(text + used, bytes + i, step);
    }
    used += step;
  }
  text[used] = '\0';
}

static clt_status read_variable(const clt_hdf *hdf, const char *name, hid_t attribute, hid_t type, char *text,
                                size_t size, clt_error *error) {
  char *found = NULL;
  if (H5Aread(attribute, type, &found) < 0) {
    return clt_hdf_refuse_read(hdf, name, error);
  }
  if (found != NULL) {
    copy_text(text, size, found, strlen(found));
    H5free_memory(found);
  }
  return CLT_OK;
}

static clt_status read_fixed(const clt_hdf *hdf, const char *name, hid_t attribute, hid_t type, char *text, size_t size,
                             clt_error *error) {
  enum { ATTRIBUTE_MAX = 1 << 16 };
  size_t length = H5Tget_size(type);
  char *found = length <= ATTRIBUTE_MAX ? clt_alloc(length, 1) : NULL;
  if (found == NULL || H5Aread(attribute, type, found) < 0) {
    free(found);
    return clt_hdf_refuse_read(hdf, name, error);
  }
  while (length > 0 && found[length - 1] == ' ' && H5Tget_strpad(type) == H5T_STR_SPACEPAD) {
    length--;
  }
  copy_text(text, size, found, length);
  free(found);
  return CLT_OK;
}

clt_status clt_hdf_read_text(const clt_hdf *hdf, const char *name, char *text, size_t size, clt_error *error) {
  hid_t attribute;
  clt_status status = open_attribute(hdf, name, &attribute, error);
  if (attribute < 0) {
    return status;
  }
  hid_t type = H5Aget_type(attribute);
  if (H5Tget_class(type) != H5T_STRING) {
    status = clt_fail(error, CLT_BAD_INPUT, "%s: the attribute %s is no string", hdf->path, name);
  } else if (H5Tis_variable_str(type) > 0) {
    status = read_variable(hdf, name, attribute, type, text, size, error);
  } else {
    status = read_fixed(hdf, name, attribute, type, text, size, error);
  }
  H5Tclose(type);
  H5Aclose(attribute);
  return status;
}

static clt_status write_attribute(const clt_hdf *hdf, const char *name, hid_t type, const void *value,
                                  clt_error *error) {
  hid_t space = H5Screate(H5S_SCALAR);
  hid_t attribute = H5Acreate2(hdf->file, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
  clt_status status =
      attribute >= 0 && H5Awrite(attribute, type, value) >= 0 ? CLT_OK : clt_hdf_refuse_write(hdf, name, error);
  if (attribute >= 0) {
    H5Aclose(attribute);
  }
  H5Sclose(space);
  return status;
}

clt_status clt_hdf_write_number(const clt_hdf *hdf, const char *name, hid_t type, const void *value, clt_error *error) {
  return write_attribute(hdf, name, type, value, error);
}

clt_status clt_hdf_write_text(const clt_hdf *hdf, const char *name, const char *text, clt_error *error) {
  hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  clt_status status = write_attribute(hdf, name, type, &text, error);
  H5Tclose(type);
  return status;
}
