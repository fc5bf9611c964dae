/* What effects cost: a flat wall with none of them, then each alone, then one more at a time; and the bare wall against
 * direct light alone, a plain loop over the cells before the same camera. */
#include "bench.h"
#include "sim/cells.h"
#include "sim/state.h"

enum { WIDTH = 64, HEIGHT = 48, TEXT_MAX = 4000 };

/* A scene is four groups of keys, which an effect adds to. */
typedef struct effect {
  const char *name, *projector, *camera, *root, *surfaces;
} effect;

static const effect effects[] = {
    {"projector-response", "response = \"srgb\"; ", "", "", ""},
    {"projector-black", "black = 0.001; ", "", "", ""},
    {"crosstalk", "crosstalk = [1.0, 0.05, 0.0, 0.03, 1.0, 0.03, 0.0, 0.05, 1.0]; ", "", "", ""},
    {"defocus", "defocus = 0.8; ", "", "", ""},
    {"latency", "latency_ms = 30.0; ", "exposure_delay_frames = 1; ", "", ""},
    {"drift", "drift = { per_hour = -0.01; amplitude = 0.005; period_s = 600.0; }; ", "", "", ""},
    {"interreflection", "", "", "",
     ", { corner = [1.5, 0.0, -1.2]; u = [0.0, -1.5, 0.0]; v = [0.0, 0.0, 2.4]; material = \"white\"; }"},
    {"occlusion", "", "", "",
     ", { corner = [-0.4, -0.8, -0.3]; u = [0.3, 0.0, 0.0]; v = [0.0, 0.0, 0.4]; material = \"white\"; }"},
    {"gloss", "", "", "",
     ", { corner = [-1.5, -1.5, -1.2]; u = [0.0, 1.5, 0.0]; v = [0.0, 0.0, 2.4]; material = \"satin\"; }"},
    {"subsurface", "", "", "subsurface = { share = 0.3; radius = 1.5; }; ", ""},
    {"ambient", "", "", "ambient = 0.002; ", ""},
    {"flicker", "", "", "ambient = 0.002; flicker = { mains_hz = 50.0; depth = 0.2; }; ", ""},
    {"change", "", "", "change = { at_s = 0.01; cells = [10, 5, 8, 8]; factor = 0.4; }; ", ""},
    {"vibration", "", "", "vibration = { amplitude = [0.2, 0.1]; hz = 12.0; }; ", ""},
    {"rolling-shutter", "", "line_us = 10.0; ", "", ""},
    {"faults", "", "faults = { dropped = 0.01; stuck = 0.001; late = 0.05; late_ms = 50.0; }; ", "", ""},
    {"lens-blur", "", "lens_blur = 0.7; ", "", ""},
    {"vignetting", "", "vignetting = 0.3; ", "", ""},
    {"noise", "", "photon_noise = true; read_noise = 4.0; ", "", ""},
    {"camera-response", "", "response = \"gamma 2.2\"; ", "", ""}};
enum { EFFECTS = sizeof effects / sizeof effects[0] };

/* The scene with the effects whose bit is set; ambient comes once. */
static clt_scene *open_scene(unsigned chosen, double *opening_ms) {
  char projector[TEXT_MAX] = "", camera[TEXT_MAX] = "", root[TEXT_MAX] = "", surfaces[TEXT_MAX] = "";
  char text[5 * TEXT_MAX];
  for (int k = 0; k < EFFECTS; k++) {
    if (chosen >> k & 1u) {
      bool twice = strstr(effects[k].root, "ambient") == effects[k].root && strstr(root, "ambient") != NULL;
      strcat(projector, effects[k].projector);
      strcat(camera, effects[k].camera);
      strcat(root, twice ? strchr(effects[k].root, ';') + 1 : effects[k].root);
      strcat(surfaces, effects[k].surfaces);
    }
  }
  const char *dark = strstr(projector, "black") ? "" : "black = 0.0; ";
  const char *linear = strstr(projector, "response") ? "" : "response = \"linear\"; ";
  const char *prompt = strstr(projector, "latency") ? "" : "latency_ms = 0.0; ";
  const char *quiet = strstr(camera, "noise") ? "" : "photon_noise = false; read_noise = 0.0; ";
  const char *ready = strstr(camera, "exposure_delay") ? "" : "exposure_delay_frames = 0; ";
  snprintf(text, sizeof text,
           "grid = { width = %d; height = %d; channels = 3; };\n%s%s\n"
           "projector = { position = [0.0, -3.0, 0.0]; target = [0.0, 0.0, 0.0]; tangent = [0.44, 0.33]; "
           "intensity = 40.0; %s%s%s%s };\ncamera = { cell_pixels = 2; %s%s%s };\n"
           "materials = ( { name = \"white\"; albedo = 0.7; }, "
           "{ name = \"satin\"; albedo = 0.5; gloss = { strength = 0.2; exponent = 20.0; }; } );\n"
           "surfaces = ( { corner = [-1.5, 0.0, -1.2]; u = [3.0, 0.0, 0.0]; v = [0.0, 0.0, 2.4]; material = \"white\"; "
           "}%s );\n",
           WIDTH, HEIGHT, strstr(root, "ambient") ? "" : "ambient = 0.0; ", root, dark, linear, prompt, projector,
           quiet, ready, camera, surfaces);
  return bench_open(text, opening_ms);
}

static void measure(const char *name, unsigned chosen, double bare_ms) {
  double opening_ms;
  clt_scene *scene = open_scene(chosen, &opening_ms);
  double ms = bench_photograph(scene);
  clt_effect_report reports[CLT_EFFECTS];
  clt_error error = {.status = CLT_OK};
  size_t bytes = 0;
  bench_need(clt_scene_effects(scene, reports, &error), &error);
  for (int k = 0; k < CLT_EFFECTS; k++) {
    bytes += reports[k].bytes;
  }
  printf("%-24s %10.1f %12.2f %9.2f %12.2f\n", name, opening_ms, ms, ms / bare_ms, 1e-6 * (double)bytes);
  clt_scene_close(scene);
}

/* b0 + F x, as plainly as it can be written. */
static void light_plainly(const clt_transport *transport, const float *factor, const float *x, float *y) {
  clt_transport_info info = clt_transport_describe(transport);
  for (int c = 0; c < info.channels; c++) {
    const float *black = clt_transport_black(transport, c);
    for (size_t i = 0; i < info.cols; i++) {
      size_t k = (size_t)c * info.cols + i;
      y[k] = (float)((double)black[i] + (double)factor[k] * (double)x[k]);
    }
  }
}

/* The bare wall's light and opening over those of direct light alone: the plain loop, and the tracing of the cells. */
static void compare_with_direct_light(clt_scene *scene, double opening_ms, double photograph_ms) {
  const clt_transport *transport = scene->transport;
  clt_transport_info info = clt_transport_describe(transport);
  size_t values = info.cols * (size_t)info.channels;
  float *factor = malloc(3 * values * sizeof *factor), *x = factor + values, *y = x + values;
  double loop_ms[BENCH_REPEATS], light_ms[BENCH_REPEATS], trace_ms[BENCH_REPEATS];
  for (size_t k = 0; k < values; k++) {
    factor[k] = scene->plan.diagonal[k];
    x[k] = (float)(k % 101) / 100.0f;
  }
  for (int n = 0; n < BENCH_REPEATS; n++) {
    clt_error error = {.status = CLT_OK};
    clt_visibility *visibility = NULL;
    clt_cells cells = {0};
    int64_t start_ns = clt_clock_ns();
    light_plainly(transport, factor, x, y);
    loop_ms[n] = 1e3 * clt_clock_since(start_ns);
    x[n] = y[n]; /* keeps the loop */
    start_ns = clt_clock_ns();
    clt_plan_light(scene, x, y);
    light_ms[n] = 1e3 * clt_clock_since(start_ns);
    start_ns = clt_clock_ns();
    bench_need(clt_visibility_create(scene->description.surfaces, 1, &visibility, &error), &error);
    bench_need(clt_cells_init(&cells, &scene->description, visibility, &error), &error);
    trace_ms[n] = 1e3 * clt_clock_since(start_ns);
    clt_cells_finish(&cells);
    clt_visibility_destroy(visibility);
  }
  double loop = bench_median(loop_ms, BENCH_REPEATS), light = bench_median(light_ms, BENCH_REPEATS);
  double trace = bench_median(trace_ms, BENCH_REPEATS);
  printf("\nthe flat wall against direct light alone: light %.4f ms, plain loop %.4f; photograph %.2f times, opening "
         "%.2f times (%.1f ms, tracing alone %.1f)\n",
         light, loop, photograph_ms / (photograph_ms - light + loop), opening_ms / trace, opening_ms, trace);
  free(factor);
}

int main(void) {
  double opening_ms;
  clt_scene *bare = open_scene(0, &opening_ms);
  double bare_ms = bench_photograph(bare);
  printf("%-24s %10s %12s %9s %12s\n", "effect", "opening,ms", "photo, ms", "ratio", "memory, MB");
  printf("%-24s %10.1f %12.2f %9.2f\n", "none: a flat wall", opening_ms, bare_ms, 1.0);
  for (int k = 0; k < EFFECTS; k++) {
    measure(effects[k].name, 1u << k, bare_ms);
  }
  printf("\none after the other\n");
  for (int k = 0; k < EFFECTS; k++) {
    char name[32];
    snprintf(name, sizeof name, "+ %s", effects[k].name);
    measure(name, (2u << k) - 1u, bare_ms);
  }
  clt_scene_close(bare);
  bare = open_scene(0, &opening_ms);
  compare_with_direct_light(bare, opening_ms, bench_photograph(bare));
  clt_scene_close(bare);
  return 0;
}
