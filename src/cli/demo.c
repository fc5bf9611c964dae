/* counterlight demo: acquire, solve, project and photograph on a simulated scene, and a report of it. */
#include "cli/demo.h"

#include <stdio.h>
#include <string.h>

#include "base/file.h"
#include "cli/command.h"
#include "cli/folder.h"
#include "cli/measure.h"
#include "cli/solve_options.h"

static const cli_option options[] = {
    {"scene", 's', "S", "scene file (default: the dihedral that comes with counterlight)"},
    {"target", 't', "PIC", "the picture to make appear (default: one that is drawn)"},
    {"output", 'o', "DIR", "folder of the results (default: demo-out)"},
    {"white", 'w', "W", "radiance of the picture's white: a number, auto or feasible"},
    {"calibration", 0, "FILE", "of the scene's rig (default: a camera with pixels of its own is calibrated first)"},
    {"scheme", 0, "NAME", "of the acquisition: auto, brute, hadamard, hierarchical or blocks"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Measures the scene's light transport through noisy frames, solves with what was measured, projects the target\n"
    "as it is and compensated, photographs both, and leaves in DIR: target.png uncompensated.png compensated.png\n"
    "pattern.png error-before.png error-after.png transport.h5 summary.json report.html, and\n"
    "calibration.h5 where the camera has pixels of its own.\n"
    "Photographs are divided by white and sRGB-encoded, the uncompensated one after its best single brightness\n"
    "factor. pattern.png holds panel values. error_limit is the bounded optimum on the scene's exact transport.\n";

static clt_status choose_scene(const char *given, demo *d, clt_error *error) {
  const char *scenes = NULL;
  d->scene = given;
  clt_status status = given ? CLT_OK : cli_scenes_folder(&scenes, error);
  if (!status && !given) {
    status = clt_file_join(scenes, "dihedral.cfg", d->own_scene, error);
    d->scene = d->own_scene;
  }
  return status ? status : clt_station_for_scene(d->scene, &d->config, error);
}

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, demo *d, clt_error *error) {
  clt_solve_options unused;
  d->target_path = cli_value(command, arguments, "target");
  clt_status status = cli_folder_choose(cli_value(command, arguments, "output"), "demo-out", d->folder, error);
  if (!status) {
    status = cli_solve_options(command, arguments, &unused, &d->white, error);
  }
  if (!status) {
    status = choose_scene(cli_value(command, arguments, "scene"), d, error);
  }
  return status ? status : cli_measure_options(command, arguments, &d->config, error);
}

static int answer(const cli_arguments *arguments, const demo *d) {
  if (arguments->json) {
    return cli_print_json(demo_summary(d));
  }
  if (arguments->quiet) {
    return CLI_DONE;
  }
  const clt_provenance *origin = clt_transport_origin(d->transport);
  printf("scene     %s, %d x %d cells, %d channel%s\n", d->scene, d->grid.width, d->grid.height, d->grid.channels,
         d->grid.channels == 1 ? "" : "s");
  printf("measured  %d patterns, %d frames, %.1f s\n", origin->patterns, origin->frames, d->timings.acquire);
  printf("solved    %s, %d iterations, %.0f ms\n", d->result.solve.method, d->result.solve.iterations,
         1e3 * d->result.solve.seconds);
  printf("seen      %.1f %% off without compensation, %.2f %% with it; no drive could do better than %.2f %%\n",
         100 * d->before.error, 100 * d->after.error, 100 * d->error_limit);
  printf("look at   %s/report.html\n", d->folder);
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  demo d = {.folder = ""};
  clt_error error = {0};
  cli_progress_begin(&d.progress, arguments->quiet);
  clt_status status = read_options(command, arguments, &d, &error);
  if (!status) {
    status = demo_run(&d, &error);
  }
  if (!status) {
    status = demo_write(&d, &error);
  }
  cli_progress_end(&d.progress);
  int code = status ? cli_fail(command, &error) : answer(arguments, &d);
  demo_finish(&d);
  return code;
}

const cli_command cli_command_demo = {
    .name = "demo",
    .synopsis = "[--scene S] [--target PIC] [-o DIR] [options]",
    .summary = "run the whole light path on a simulated scene and report it",
    .options = options,
    .run = run,
    .notes = notes,
};
