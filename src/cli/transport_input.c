/* A transport file as an argument: loaded and certified. */
#include "cli/transport_input.h"

#include <string.h>

void cli_white(const clt_certificate *certificate, int channels, double *white) {
  for (int c = 0; c < channels; c++) {
    double median = clt_certificate_channel(certificate, c)->white;
    white[c] = median > 0 ? median : 1;
  }
}

static clt_status read_response(cli_input *input, clt_error *error) {
  const char *text = clt_transport_origin(input->transport)->response;
  input->response = (clt_curve){.kind = CLT_CURVE_SRGB};
  return *text ? clt_curve_parse(text, &input->response, error) : CLT_OK;
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

void cli_input_close(cli_input *input) {
  clt_certificate_destroy(input->certificate);
  clt_transport_destroy(input->transport);
  memset(input, 0, sizeof *input);
}
