/* What light costs as the grid grows: opening, memory and a photograph of a dihedral in three colours, and the error of
 * its light at sampled cells. Usage: bench_scale [REFERENCE_CELLS]. */
#include <math.h>
#include <sys/resource.h>

#include "bench.h"

static const struct { int width, height; } grids[] = {{128, 64}, {256, 128}, {512, 256}, {1024, 512}};
enum { GRIDS = sizeof grids / sizeof grids[0] };

static clt_scene *open_dihedral(int width, int height, double *opening_ms) {
  char text[1200];
  snprintf(text, sizeof text,
           "grid = { width = %d; height = %d; channels = 3; }; camera = { cell_pixels = 1; };\n"
           "projector = { position = [0.06, -3.2, 0.03]; target = [0.0, 0.0, 0.0]; tangent = [0.44, 0.33]; "
           "intensity = 40.0; };\nmaterials = ( { name = \"white\"; albedo = 0.7; } );\nsurfaces = (\n"
           "{ corner = [-1.25, -1.25, -1.3]; u = [1.25, 1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"white\"; },\n"
           "{ corner = [0.0, 0.0, -1.3]; u = [1.25, -1.25, 0.0]; v = [0.0, 0.0, 2.6]; material = \"white\"; } );\n",
           width, height);
  return bench_open(text, opening_ms);
}

/* Median time of T x in every channel, ms. */
static double time_light(const clt_scene *scene) {
  const clt_transport *transport = clt_scene_transport(scene);
  clt_transport_info info = clt_transport_describe(transport);
  size_t values = info.cols * (size_t)info.channels;
  double *x = malloc(2 * values * sizeof *x), ms[BENCH_REPEATS];
  for (size_t k = 0; k < values; k++) {
    x[k] = (double)(k % 101) / 100.0;
  }
  for (int n = 0; n < BENCH_REPEATS; n++) {
    int64_t start_ns = clt_clock_ns();
    clt_transport_apply_all(transport, x, x + values);
    ms[n] = 1e3 * clt_clock_since(start_ns);
  }
  free(x);
  return bench_median(ms, BENCH_REPEATS);
}

static void time_reference(clt_scene *scene, int width, int height, int cells) {
  clt_error error = {.status = CLT_OK};
  clt_image drive = {0};
  clt_reference found;
  bench_need(clt_image_init(&drive, 3, height, width, &error), &error);
  for (size_t k = 0; k < clt_image_size(&drive); k++) {
    drive.data[k] = (float)(k * 7919 % 1021) / 1020.0f;
  }
  bench_need(clt_scene_reference(scene, &drive, cells, &found, &error), &error);
  printf("  rms %.1e, largest %.1e", found.rms, found.largest);
  clt_image_finish(&drive);
}

int main(int count, char **words) {
  int reference = count > 1 ? atoi(words[1]) : 0;
  double first[3] = {0}, last[3] = {0};
  printf("%-12s %9s %12s %12s %14s %10s%s\n", "grid", "cells", "opening, ms", "light, ms", "photograph, ms",
         "peak, MiB", reference > 0 ? "  error of the light" : "");
  for (int k = 0; k < GRIDS; k++) {
    double opening_ms;
    clt_scene *scene = open_dihedral(grids[k].width, grids[k].height, &opening_ms);
    double light_ms = time_light(scene), photograph_ms = bench_photograph(scene);
    struct rusage use;
    getrusage(RUSAGE_SELF, &use);
    printf("%4d x %-5d %9d %12.1f %12.2f %14.2f %10.0f", grids[k].width, grids[k].height,
           grids[k].width * grids[k].height, opening_ms, light_ms, photograph_ms, (double)use.ru_maxrss / 1024.0);
    if (reference > 0) {
      time_reference(scene, grids[k].width, grids[k].height, reference);
    }
    printf("\n");
    double figures[3] = {opening_ms, light_ms, photograph_ms};
    memcpy(k == 0 ? first : last, figures, sizeof figures);
    clt_scene_close(scene);
  }
  double cells = (double)grids[GRIDS - 1].width * grids[GRIDS - 1].height / (grids[0].width * grids[0].height);
  printf("exponent over %g times the cells: opening %.2f, light %.2f, photograph %.2f (N log N is %.2f)\n", cells,
         log(last[0] / first[0]) / log(cells), log(last[1] / first[1]) / log(cells),
         log(last[2] / first[2]) / log(cells),
         1.0 + log(log(cells * grids[0].width * grids[0].height) / log(grids[0].width * grids[0].height)) / log(cells));
  return 0;
}
