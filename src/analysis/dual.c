/* The dual photograph. */
#include <stdlib.h>

#include "base/memory.h"
#include "counterlight/analysis.h"

static clt_status check_light(const clt_transport_info *info, const clt_image *light, clt_error *error) {
  if (info->rows != info->cols) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the transport observes %zu cells but drives %zu; a dual photograph needs a camera that shares the "
                    "projector's grid",
                    info->rows, info->cols);
  }
  if (light->channels != info->channels || light->height != info->height || light->width != info->width) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "the light is %d x %d with %d channels, but the transport's grid is %d x %d with %d; resize it",
                    light->width, light->height, light->channels, info->width, info->height, info->channels);
  }
  return CLT_OK;
}

clt_status clt_dual_photograph(const clt_transport *transport, const clt_image *light, clt_image *seen,
                               clt_error *error) {
  clt_transport_info info = clt_transport_describe(transport);
  *seen = (clt_image){0};
  clt_status status = check_light(&info, light, error);
  if (status != CLT_OK) {
    return status;
  }
  double *y = clt_alloc(info.rows, sizeof *y), *x = clt_alloc(info.cols, sizeof *x);
  status = y && x ? clt_image_init(seen, info.channels, info.height, info.width, error)
                  : clt_fail(error, CLT_FAILED, "not enough memory for %zu cells", info.rows);
  for (int c = 0; c < info.channels && status == CLT_OK; c++) {
    for (size_t i = 0; i < info.rows; i++) {
      y[i] = light->data[(size_t)c * info.rows + i];
    }
    clt_transport_apply_transposed(transport, c, y, x);
    for (size_t i = 0; i < info.cols; i++) {
      seen->data[(size_t)c * info.cols + i] = (float)x[i];
    }
  }
  free(y);
  free(x);
  return status;
}
