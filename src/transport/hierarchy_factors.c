#include "transport/hierarchy_factors.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "transport/check.h"

/* How a side's rows may lie in a file. */
typedef struct form {
  int bits;
  const char *name[2], *scale[2]; /* of left and right */
} form;

enum { FORMS = 3 };
static const form FORM[FORMS] = {
    {32, {"/hierarchy/left", "/hierarchy/right"}, {NULL, NULL}},
    {16, {"/hierarchy/left16", "/hierarchy/right16"}, {"/hierarchy/left16_scale", "/hierarchy/right16_scale"}},
    {8, {"/hierarchy/left8", "/hierarchy/right8"}, {"/hierarchy/left8_scale", "/hierarchy/right8_scale"}}};

static const form *form_of(int bits) {
  const form *of = FORM;
  while (of->bits != bits) {
    of++;
  }
  return of;
}

/* The form that a file has of a side: floats where it has none, so that they are missed by name. */
static const form *find_form(const clt_hdf *hdf, int side) {
  const form *found = FORM;
  for (int k = 0; k < FORMS; k++) {
    found = clt_hdf_has(hdf, FORM[k].name[side]) ? &FORM[k] : found;
  }
  return found;
}

static clt_leaf_rows *side_of(const clt_transport *transport, int side) {
  clt_hierarchy_storage *own = transport->storage;
  return side == 0 ? &own->left : &own->right;
}

/* The numbers of a side, and their scales; half is the type of half precision. */
static void list_parts(const clt_leaf_rows *rows, int side, hid_t half, clt_hdf_array parts[2]) {
  const form *of = form_of(rows->bits);
  const size_t nodes = CLT_LEAF_TERMS * rows->leaves;
  const hid_t type = rows->bits == 32 ? H5T_NATIVE_FLOAT : rows->bits == 16 ? half : H5T_NATIVE_INT8;
  void *numbers = rows->bits == 32 ? (void *)rows->value : rows->bits == 16 ? (void *)rows->half : (void *)rows->byte;
  parts[0] = (clt_hdf_array){of->name[side], type, 3, {rows->sets, nodes, rows->rank}, numbers};
  parts[1] = (clt_hdf_array){of->scale[side],
                             H5T_NATIVE_FLOAT,
                             rows->bits == 8 ? 3 : 2,
                             {rows->sets, nodes, clt_leaf_rows_blocks(rows->rank)},
                             rows->scale};
}

/* Takes over what was read. */
static void keep_parts(clt_leaf_rows *rows, const clt_hdf_array parts[2]) {
  rows->sets = parts[0].shape[0];
  rows->rank = parts[0].shape[2];
  rows->value = rows->bits == 32 ? parts[0].data : NULL;
  rows->half = rows->bits == 16 ? parts[0].data : NULL;
  rows->byte = rows->bits == 8 ? parts[0].data : NULL;
}

static clt_status read_side(clt_transport *transport, int side, const clt_hdf *hdf, hid_t half, clt_error *error) {
  const clt_hierarchy_storage *own = transport->storage;
  clt_leaf_rows *rows = side_of(transport, side);
  clt_hdf_array parts[2];
  *rows = (clt_leaf_rows){.bits = find_form(hdf, side)->bits, .leaves = own->leaves};
  clt_leaf_rows_choose(rows);
  list_parts(rows, side, half, parts);
  parts[0].shape[0] = side == 0 ? CLT_HDF_ANY : own->left.sets;
  parts[0].shape[2] = side == 0 ? CLT_HDF_ANY : own->left.rank;
  clt_status status = clt_hdf_read(hdf, &parts[0], error);
  if (status != CLT_OK) {
    return status;
  }
  keep_parts(rows, parts);
  if (rows->bits < 32) {
    list_parts(rows, side, half, parts);
    status = clt_hdf_read(hdf, &parts[1], error);
    rows->scale = parts[1].data;
  }
  return status;
}

static clt_hdf_array core_part(const clt_transport *transport) {
  const clt_hierarchy_storage *own = transport->storage;
  return (clt_hdf_array){
      "/hierarchy/core", H5T_NATIVE_FLOAT, 3, {(size_t)transport->channels, own->rank, own->rank}, own->core};
}

/* Channels have rows of their own, or all the same rows and cores. */
static clt_status read_core(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  const size_t sets = own->left.sets, channels = (size_t)transport->channels;
  if (sets == channels) {
    return CLT_OK;
  }
  if (sets != 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "%s: %s has rows of %zu channels; there are %zu: it has those of each, or one for all", hdf->path,
                    form_of(own->left.bits)->name[0], sets, channels);
  }
  clt_hdf_array part = core_part(transport);
  const clt_status status = clt_hdf_read(hdf, &part, error);
  own->core = part.data;
  return status;
}

clt_status clt_hierarchic_load_factors(clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  clt_hierarchy_storage *own = transport->storage;
  const hid_t half = clt_hdf_half();
  clt_status status = read_side(transport, 0, hdf, half, error);
  own->rank = own->left.rank;
  if (status == CLT_OK) {
    status = read_side(transport, 1, hdf, half, error);
  }
  H5Tclose(half);
  return status == CLT_OK ? read_core(transport, hdf, error) : status;
}

clt_status clt_hierarchic_save_factors(const clt_transport *transport, const clt_hdf *hdf, clt_error *error) {
  const clt_hierarchy_storage *own = transport->storage;
  const hid_t half = clt_hdf_half();
  clt_status status = CLT_OK;
  for (int side = 0; side < 2 && status == CLT_OK; side++) {
    clt_hdf_array parts[2];
    list_parts(side_of(transport, side), side, half, parts);
    for (int k = 0; k < (side_of(transport, side)->bits < 32 ? 2 : 1) && status == CLT_OK; k++) {
      status = clt_hdf_write(hdf, &parts[k], error);
    }
  }
  H5Tclose(half);
  if (status == CLT_OK && own->core != NULL) {
    const clt_hdf_array part = core_part(transport);
    status = clt_hdf_write(hdf, &part, error);
  }
  return status;
}

/* The rows of every leaf; room holds those of one. */
static clt_status check_rows(const clt_transport *transport, int side, const char *source, float *room,
                             clt_error *error) {
  const clt_leaf_rows *rows = side_of(transport, side);
  for (size_t set = 0; set < rows->sets; set++) {
    for (size_t leaf = 0; leaf < rows->leaves; leaf++) {
      clt_leaf_rows_read(rows, (int)set, leaf, room);
      for (size_t k = 0; k < CLT_LEAF_TERMS * rows->rank; k++) {
        if (!isfinite(room[k])) {
          return clt_fail(error, CLT_BAD_INPUT, "%s: %s[%zu, %zu, %zu] is %g; values must be finite", source,
                          form_of(rows->bits)->name[side], set, CLT_LEAF_TERMS * leaf + k / rows->rank, k % rows->rank,
                          (double)room[k]);
        }
      }
    }
  }
  return CLT_OK;
}

clt_status clt_hierarchic_check_factors(const clt_transport *transport, const char *source, clt_error *error) {
  const clt_hierarchy_storage *own = transport->storage;
  float *room = clt_alloc(own->rank, CLT_LEAF_TERMS * sizeof *room);
  clt_status status =
      room != NULL ? CLT_OK
                   : clt_fail(error, CLT_FAILED, "%s: no memory to check far light of rank %zu", source, own->rank);
  for (int side = 0; side < 2 && status == CLT_OK; side++) {
    status = check_rows(transport, side, source, room, error);
  }
  free(room);
  if (status == CLT_OK && own->core != NULL) {
    const clt_values core = {.source = source,
                             .name = "/hierarchy/core",
                             .rank = 3,
                             .shape = {(size_t)transport->channels, own->rank, own->rank},
                             .data = own->core};
    status = clt_check_finite(&core, error);
  }
  return status;
}
