/* counterlight inspect: what a transport file holds and how it will be inverted. */
#include <stdlib.h>
#include <time.h>

#include "cli/answer.h"
#include "cli/command.h"
#include "cli/solve_options.h"
#include "cli/transport_input.h"

static const cli_option options[] = {
    {"tolerance", 0, "X", "relative residual that the forecasts are for (default 1e-4)"},
    {"deadline-ms", 0, "X", "time that they may take (default: any)"},
    {NULL, 0, NULL, NULL},
};

typedef struct choice {
  char method[sizeof((clt_solve_result *)0)->method];
  char reason[sizeof((clt_solve_result *)0)->reason];
} choice;

/* What auto takes: asked of the solver itself, with an even grey for a target. */
static clt_status ask_auto(const cli_input *input, const clt_solve_options *asked, choice *taken, clt_error *error) {
  clt_image grey, drive = {0};
  clt_compensation result;
  clt_status status = clt_image_init(&grey, input->grid.channels, input->grid.height, input->grid.width, error);
  if (status) {
    return status;
  }
  size_t count = clt_image_size(&grey);
  for (size_t i = 0; i < count; i++) {
    grey.data[i] = 0.5f;
  }
  status = clt_compensate(input->transport, input->certificate, &grey, &(clt_white){.kind = CLT_WHITE_AUTO}, asked,
                          false, &drive, &result, error);
  if (!status) {
    snprintf(taken->method, sizeof taken->method, "%s", result.solve.method);
    snprintf(taken->reason, sizeof taken->reason, "%s", result.solve.reason);
  }
  clt_image_finish(&grey);
  clt_image_finish(&drive);
  return status;
}

/* Bai et al. 2010, eq. 43 converges where rho(R) < 1. */
static const char *jacobi_verdict(const clt_channel_certificate *channel) {
  return channel->radius_high < 1 ? "converges" : channel->radius_low >= 1 ? "diverges" : "not certain";
}

static json_t *channel_json(const clt_channel_certificate *channel) {
  return json_pack("{s:I, s:I, s:o, s:o, s:o, s:o, s:o, s:s}", "lit", (json_int_t)channel->lit, "dark",
                   (json_int_t)channel->dark, "radius_low", cli_json_number(channel->radius_low), "radius_high",
                   cli_json_number(channel->radius_high), "norm_high", cli_json_number(channel->norm_high),
                   "reciprocity_defect", cli_json_number(channel->reciprocity), "white",
                   cli_json_number(channel->white), "jacobi", jacobi_verdict(channel));
}

static clt_forecast foretell(const cli_input *input, const clt_solve_options *asked, const char *method) {
  clt_solve_options one = *asked;
  clt_forecast foretold;
  clt_error error = {0};
  one.method = method;
  if (clt_forecast_solve(input->transport, input->certificate, &one, &foretold, &error)) {
    foretold = (clt_forecast){.iterations = -1, .seconds = -1};
    snprintf(foretold.why_not, sizeof foretold.why_not, "%s", error.message);
  }
  return foretold;
}

static json_t *known(double value) {
  return value >= 0 ? cli_json_number(value) : json_null();
}

static json_t *forecasts_json(const cli_input *input, const clt_solve_options *asked) {
  json_t *list = json_array();
  for (size_t m = 0; clt_method_name(m); m++) {
    clt_forecast f = foretell(input, asked, clt_method_name(m));
    json_t *one = json_pack("{s:s, s:b}", "method", clt_method_name(m), "possible", f.possible);
    json_object_set_new(one, "why_not", f.possible ? json_null() : json_string(f.why_not));
    json_object_set_new(one, "iterations", f.iterations >= 0 ? json_integer(f.iterations) : json_null());
    json_object_set_new(one, "residual", f.iterations >= 0 ? cli_json_number(f.residual) : json_null());
    json_object_set_new(one, "solve_ms", known(f.iterations >= 0 ? 1e3 * f.seconds : -1));
    json_object_set_new(one, "prepare_ms", known(f.iterations >= 0 ? 1e3 * f.prepare_seconds : -1));
    json_array_append_new(list, one);
  }
  return list;
}

static void print_forecasts(const cli_input *input, const clt_solve_options *asked) {
  printf("foretold     %-15s iterations       solve    made ready   residual\n", "method");
  for (size_t m = 0; clt_method_name(m); m++) {
    clt_forecast f = foretell(input, asked, clt_method_name(m));
    if (!f.possible) {
      printf("             %-15s %s\n", clt_method_name(m), f.why_not);
    } else if (f.iterations < 0) {
      printf("             %-15s not known where rows and columns differ\n", clt_method_name(m));
    } else {
      printf("             %-15s %10d %8.2f ms %10.2f ms   %8.1e\n", clt_method_name(m), f.iterations, 1e3 * f.seconds,
             1e3 * f.prepare_seconds, f.residual);
    }
  }
}

static json_t *inspect_json(const cli_input *input, const clt_transport_info *info, const clt_solve_options *asked,
                            const choice *taken) {
  json_t *channels = json_array();
  for (int c = 0; c < info->channels; c++) {
    json_array_append_new(channels, channel_json(clt_certificate_channel(input->certificate, c)));
  }
  return json_pack("{s:o, s:I, s:I, s:s, s:I, s:o, s:o, s:o, s:{s:s, s:s}}", "grid", cli_json_grid(&input->grid),
                   "rows", (json_int_t)info->rows, "cols", (json_int_t)info->cols, "storage", info->storage, "bytes",
                   (json_int_t)info->bytes, "channels", channels, "forecasts", forecasts_json(input, asked),
                   "provenance", cli_json_provenance(clt_transport_origin(input->transport)), "auto", "method",
                   taken->method, "reason", taken->reason);
}

static void print_origin(const clt_provenance *origin) {
  char when[40] = "at an unknown time";
  time_t seconds = (time_t)origin->acquired;
  struct tm local;
  if (origin->acquired > 0 && localtime_r(&seconds, &local)) {
    strftime(when, sizeof when, "%Y-%m-%d %H:%M:%S", &local);
  }
  printf("measured     %s, %s%s%s\n", when, *origin->scheme ? origin->scheme : "scheme not known",
         *origin->source ? ", on " : "", origin->source);
  if (origin->patterns > 0) {
    printf("             %d patterns, %d frames, %.1f s\n", origin->patterns, origin->frames, origin->seconds);
  }
  if (origin->error >= 0) {
    printf("             check patterns come out %.2f %% off\n", 100 * origin->error);
  }
  printf("response     %s\n", *origin->response ? origin->response : "not named: sRGB");
}

static void print_text(const cli_input *input, const clt_transport_info *info, const clt_solve_options *asked,
                       const choice *taken) {
  printf("grid         %d x %d cells, %d channel%s\n", info->width, info->height, info->channels,
         info->channels == 1 ? "" : "s");
  printf("storage      %s, %zu rows x %zu columns, %.1f MB a product\n", info->storage, info->rows, info->cols,
         1e-6 * (double)info->bytes);
  print_origin(clt_transport_origin(input->transport));
  for (int c = 0; c < info->channels; c++) {
    const clt_channel_certificate *channel = clt_certificate_channel(input->certificate, c);
    printf("channel %d    %zu cells lit, %zu dark; white %.4g\n", c, channel->lit, channel->dark, channel->white);
    printf("             rho(R) in %.4f .. %.4f (Jacobi: %s), |R| <= %.4f, reciprocity defect %.2g\n",
           channel->radius_low, channel->radius_high, jacobi_verdict(channel), channel->norm_high,
           channel->reciprocity);
  }
  print_forecasts(input, asked);
  printf("auto takes   %s: %s\n", taken->method, taken->reason);
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  cli_input input;
  choice taken = {.method = ""};
  clt_error error = {0};
  clt_solve_options asked;
  clt_white white;
  if (cli_solve_options(command, arguments, &asked, &white, &error) ||
      cli_input_open(arguments->positional[0], &input, &error)) {
    return cli_fail(command, &error);
  }
  int code = CLI_DONE;
  clt_transport_info info = clt_transport_describe(input.transport);
  if (ask_auto(&input, &asked, &taken, &error)) {
    code = cli_fail(command, &error);
  } else if (arguments->json) {
    code = cli_print_json(inspect_json(&input, &info, &asked, &taken));
  } else if (!arguments->quiet) {
    print_text(&input, &info, &asked, &taken);
  }
  cli_input_close(&input);
  return code;
}

static const char notes[] =
    "rho(R) is bracketed by the Collatz-Wielandt bounds of the interreflection operator R = T F^-1 - I; below 1 the\n"
    "plain iteration (Bai et al. 2010, eq. 43) converges. The reciprocity defect is near 0 for a diffuse, calibrated\n"
    "room. auto is asked with an even grey for a target; a picture that reaches the limits 0 or 1 may get another.\n"
    "What each method would take is foretold by the certificate, which tried S on a random picture and timed that:\n"
    "iterations within a half for the methods by products (but lsmr, bounded), mostly within a factor of two for the\n"
    "others; times as steady as the machine is. bounded is foretold for a picture that every cell can reach.\n";

const cli_command cli_command_inspect = {
    .name = "inspect",
    .synopsis = "T.h5 [--tolerance X] [--deadline-ms X]",
    .summary = "say what a transport holds and how it will be inverted",
    .options = options,
    .positional_least = 1,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
