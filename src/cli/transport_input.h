/* A transport file as an argument: loaded and certified. */
#ifndef CLT_CLI_TRANSPORT_INPUT_H
#define CLT_CLI_TRANSPORT_INPUT_H

#include "cli/picture.h"
#include "counterlight/solve.h"
#include "counterlight/transport.h"

typedef struct cli_input {
  clt_transport *transport;
  clt_certificate *certificate;
  cli_grid grid;
  clt_panel panel;                /* of the projector it was measured with; sRGB where the file does not say */
  bool panel_unknown;             /* the file says only that a calibration has it */
  double white[CLT_CHANNELS_MAX]; /* median F of each channel: the radiance that white means by default */
} cli_input;

/* Loads, certifies and describes; CLT_BAD_INPUT names file and field. On failure nothing needs to be closed. */
clt_status cli_input_open(const char *path, cli_input *input, clt_error *error);
/* Takes the panel of a calibration file (NULL: leaves it as it is). */
clt_status cli_input_calibrate(const char *path, cli_input *input, clt_error *error);
/* CLT_BAD_INPUT where path would hold panel values and the panel is not known. */
clt_status cli_input_check_drive(const cli_input *input, const char *path, clt_error *error);
/* CLT_BAD_INPUT where no cell is lit: no drive changes what is seen, and an error of 0 would say nothing. */
clt_status cli_input_check_lit(const cli_input *input, const char *path, clt_error *error);
void cli_input_close(cli_input *input);

/* The white of every channel as the certificate has it; 1 where a channel has no lit cell. */
void cli_white(const clt_certificate *certificate, int channels, double *white);

#endif
