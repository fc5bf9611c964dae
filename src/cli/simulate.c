/* counterlight simulate: a photograph of a scene under a drive. */
#include <stdlib.h>
#include <string.h>

#include "cli/answer.h"
#include "cli/command.h"
#include "cli/photograph.h"
#include "cli/picture.h"
#include "counterlight/solve.h"
#include "counterlight/station.h"

static const cli_option options[] = {
    {"drive", 'd', "PIC", "what the projector shows"},
    {"output", 'o', "OUT", "where the picture goes (.png, .exr, .npy)"},
    {"exact", 0, NULL, "the scene's noise-free radiance, without a camera"},
    {"map", 0, "MAP", "where the camera's true pixel map goes (.npy), of a camera with pixels of its own"},
    {"reference", 0, "N", "compare the light of N cells with exactly computed rows, and say how far it is off"},
    {"furnace", 0, "M", "let all surfaces glow and reflect M, and say how bright that makes them"},
    {NULL, 0, NULL, NULL},
};

static const char notes[] =
    "Photographs the scene through its own simulated projector and camera, noise included, as the rig does it:\n"
    "exposure bracket, black level and response curves undone, means over the grid's cells, b0 included.\n"
    "A camera with pixels of its own is photographed pixel by pixel. --map writes what its pixels really see: three\n"
    "planes, x and y of the place in the projector's picture, in cells (cell k spans k to k + 1; NaN where it is not\n"
    "lit), and 1 where it is lit, 0 where nothing is seen, 2 in a shadow, 3 beyond the projector's picture.\n"
    "--exact takes b0 + T x from the scene instead. --reference N says how far the simulated light is from the exact\n"
    "one at N cells spread over the grid: at most 6400 cells by rows of T in double, above by gathering the light of\n"
    "every surface element by its form factor.\n"
    "--furnace M lets every surface glow with radiance 1 and reflect M: in a closed room all are 1/(1-M) bright.\n"
    "A .png or .jpg drive holds panel values and is decoded by the scene's projector response; .exr and .npy hold\n"
    "linear light in 0..1. A .png result is divided by the scene's white (the median direct light of a fully driven\n"
    "cell) and sRGB-encoded; .exr and .npy hold the radiance.\n";

typedef struct task {
  const char *drive_path, *output, *map_path; /* map_path: NULL for none */
  bool exact;
  int reference_cells; /* 0: none */
  clt_reference reference;
  double furnace_albedo; /* < 0: none */
  clt_furnace furnace;
  clt_station_config config;
  clt_station station;
  clt_rig_config rig;
  double white[CLT_CHANNELS_MAX];
  cli_grid grid;
  bool own_pixels; /* of the camera */
  clt_image drive, seen, deviation, map;
} task;

static clt_status read_options(const cli_command *command, const cli_arguments *arguments, task *t, clt_error *error) {
  clt_status status = cli_required(command, arguments, "drive", &t->drive_path, error);
  if (!status) {
    status = cli_required(command, arguments, "output", &t->output, error);
  }
  t->exact = cli_value(command, arguments, "exact") != NULL;
  if (!status) {
    status = cli_integer(command, arguments, "reference", 1, 4096, &t->reference_cells, error);
  }
  t->map_path = cli_value(command, arguments, "map");
  if (!status && t->map_path != NULL) {
    size_t length = strlen(t->map_path);
    status = length > 4 && strcmp(t->map_path + length - 4, ".npy") == 0
                 ? cli_picture_output_check(t->map_path, error)
                 : clt_fail(error, CLT_BAD_INPUT, "--map %s: a map holds what is no picture; end its name in .npy",
                            t->map_path);
  }
  t->furnace_albedo = -1.0;
  if (!status) {
    status = cli_number(command, arguments, "furnace", 0.0, 0.9999, &t->furnace_albedo, error);
  }
  return status ? status : cli_picture_output_check(t->output, error);
}

static clt_status open_scene(const char *path, task *t, clt_error *error) {
  clt_status status = clt_station_for_scene(path, &t->config, error);
  if (!status) {
    status = clt_station_open(&t->config, &t->station, error);
  }
  if (status) {
    return status;
  }
  const clt_transport *transport = clt_scene_transport(t->station.scene);
  clt_transport_info info = clt_transport_describe(transport);
  t->grid = (cli_grid){info.width, info.height, info.channels};
  clt_scene_rig_config(t->station.scene, &t->rig);
  clt_camera_info sensor;
  t->station.camera->driver->describe(t->station.camera, &sensor);
  t->own_pixels = sensor.own_pixels;
  status = clt_certify_white(transport, t->white, error);
  for (int c = 0; !status && c < info.channels; c++) {
    t->white[c] = t->white[c] > 0 ? t->white[c] : 1;
  }
  return status;
}

/* As the rig sees it, a mean for each cell; or pixel by pixel, where no rig knows which cell they see. */
static clt_status photograph(task *t, clt_error *error) {
  if (t->own_pixels) {
    return cli_photograph(&t->station, &t->rig, &t->drive, &t->seen, error);
  }
  clt_status status = clt_station_open_rig(&t->config, &t->station, NULL, error);
  if (!status) {
    status = clt_image_init(&t->seen, t->grid.channels, t->grid.height, t->grid.width, error);
  }
  if (!status) {
    status = clt_image_init(&t->deviation, t->grid.channels, t->grid.height, t->grid.width, error);
  }
  return status ? status
                : t->station.rig->operations->observe(t->station.rig, &t->drive, &t->seen, &t->deviation, error);
}

static clt_status simulate(const char *path, task *t, clt_error *error) {
  clt_status status = open_scene(path, t, error);
  if (!status && t->map_path != NULL) {
    status = clt_scene_pixel_map(t->station.scene, &t->map, error);
  }
  if (!status) {
    clt_panel panel = clt_panel_of_curve(&t->rig.projector.response[0]);
    status = cli_drive_read(t->drive_path, &panel, &t->grid, &t->drive, error);
  }
  if (!status) {
    status = t->exact ? clt_scene_appearance(t->station.scene, &t->drive, &t->seen, error) : photograph(t, error);
  }
  if (!status && t->reference_cells > 0) {
    status = clt_scene_reference(t->station.scene, &t->drive, t->reference_cells, &t->reference, error);
  }
  if (!status && t->map_path != NULL) {
    status = clt_image_write(t->map_path, NULL, &t->map, error);
  }
  if (!status && t->furnace_albedo >= 0.0) {
    status = clt_scene_furnace(t->station.scene, t->furnace_albedo, &t->furnace, error);
  }
  return status ? status : cli_radiance_write(t->output, &t->seen, t->white, error);
}

static int answer(const cli_arguments *arguments, const task *t) {
  const clt_reference *found = &t->reference;
  if (arguments->json) {
    json_t *document = json_pack("{s:s, s:b, s:o, s:o}", "output", t->output, "exact", t->exact, "grid",
                                 cli_json_grid(&t->grid), "white", cli_json_numbers(t->white, t->grid.channels));
    if (t->own_pixels && !t->exact) {
      json_object_set_new(document, "pixels",
                          json_pack("{s:i, s:i}", "width", t->seen.width, "height", t->seen.height));
    }
    if (t->map_path != NULL) {
      json_object_set_new(document, "map", json_string(t->map_path));
    }
    if (found->cells > 0) {
      json_object_set_new(document, "reference",
                          json_pack("{s:i, s:f, s:f, s:f}", "cells", found->cells, "rms", found->rms, "largest",
                                    found->largest, "bound", found->bound));
    }
    if (t->furnace.elements > 0) {
      json_object_set_new(document, "furnace",
                          json_pack("{s:f, s:i, s:f, s:f}", "albedo", t->furnace_albedo, "elements",
                                    t->furnace.elements, "least", t->furnace.least, "greatest", t->furnace.greatest));
    }
    return cli_print_json(document);
  }
  if (!arguments->quiet) {
    printf("%s: %s\n", t->output, t->exact ? "the scene's exact radiance" : "the scene as its camera saw it");
    if (found->cells > 0) {
      printf("its light is %.2g off the exact one (rms of %d cells; largest %.2g, bound %.2g)\n", found->rms,
             found->cells, found->largest, found->bound);
    }
    if (t->furnace.elements > 0) {
      printf("as a furnace of albedo %g its %d surface elements are %.9g to %.9g bright; a closed room is %.9g\n",
             t->furnace_albedo, t->furnace.elements, t->furnace.least, t->furnace.greatest,
             1.0 / (1.0 - t->furnace_albedo));
    }
  }
  return CLI_DONE;
}

static int run(const cli_command *command, const cli_arguments *arguments) {
  task t = {0};
  clt_error error = {0};
  clt_status status = read_options(command, arguments, &t, &error);
  if (!status) {
    status = simulate(arguments->positional[0], &t, &error);
  }
  int code = status ? cli_fail(command, &error) : answer(arguments, &t);
  clt_image_finish(&t.drive);
  clt_image_finish(&t.seen);
  clt_image_finish(&t.deviation);
  clt_image_finish(&t.map);
  clt_station_close(&t.station);
  return code;
}

const cli_command cli_command_simulate = {
    .name = "simulate",
    .synopsis = "SCENE --drive PIC -o OUT [--exact] [--map MAP] [--reference N] [--furnace M]",
    .summary = "photograph a simulated scene under a drive",
    .options = options,
    .positional_least = 1,
    .positional_most = 1,
    .run = run,
    .notes = notes,
};
