/* A transport file as an argument: loaded and certified. */
#include "cli/transport_input.h"

#include <string.h>

#include "counterlight/calibration.h"

/* What clt_curve_format calls a measured curve. */
static const char measured_response[] = "table";

void cli_white(const clt_certificate *certificate, int channels, double *white) {
  for (int c = 0; c < channels; c++) {
    double median = clt_certificate_channel(certificate, c)->white;
    white[c] = median > 0 ? median : 1;
  }
}

static clt_status read_response(cli_input *input, clt_error *error) {
  const char *text = clt_transport_origin(input->transport)->response;
  clt_curve response = {.kind = CLT_CURVE_SRGB};
  input->panel_unknown = strcmp(text, measured_response) == 0;
  clt_status status = *text && !input->panel_unknown ? clt_curve_parse(text, &response, error) : CLT_OK;
  input->panel = clt_panel_of_curve(&response);
  return status;
}

clt_status cli_input_calibrate(const char *path, cli_input *input, clt_error *error) {
  clt_calibration *calibration = NULL;
  clt_status status = path ? clt_calibration_load(path, &calibration, error) : CLT_OK;
  if (calibration) {
    input->panel = clt_calibration_describe(calibration).panel;
    input->panel_unknown = false;
  }
  clt_calibration_destroy(calibration);
  return status;
}

clt_status cli_input_check_drive(const cli_input *input, const char *path, clt_error *error) {
  return !input->panel_unknown || clt_image_path_is_linear(path)
             ? CLT_OK
             : clt_fail(error, CLT_BAD_INPUT,
                        "%s: the response of the transport's projector was measured: give --calibration "
                        "calibration.h5 (compensate and relight take it), or a drive in .npy or .exr",
                        path);
}

clt_status cli_input_open(const char *path, cli_input *input, clt_error *error) {
  memset(input, 0, sizeof *input);
  clt_status status = clt_transport_load(path, &input->transport, error);
  if (status) {
    return status;
  }
  clt_transport_info info = clt_transport_describe(input->transport);
  input->grid = (cli_grid){info.width, info.height, info.channels};
  if (read_response(input, error) || clt_certify(input->transport, &input->certificate, error)) {
    status = clt_fail_within(error, "%s: ", path);
    cli_input_close(input);
    return status;
  }
  cli_white(input->certificate, info.channels, input->white);
  return CLT_OK;
}

clt_status cli_input_check_lit(const cli_input *input, const char *path, clt_error *error) {
  if (clt_certificate_any_lit(input->certificate)) {
    return CLT_OK;
  }
  return clt_fail(error, CLT_BAD_INPUT,
                  "%s: no cell of this transport is lit, so no drive changes what is seen; measure the transport again",
                  path);
}

void cli_input_close(cli_input *input) {
  clt_certificate_destroy(input->certificate);
  clt_transport_destroy(input->transport);
  memset(input, 0, sizeof *input);
}
