/* Patterns against error: every acquisition scheme on simulated rooms, with the noise of their cameras.
 *
 * Usage: bench_schemes SCENES SCENE WIDTH HEIGHT SCHEME[:VALUE] ... (SCENES: the folder of the scene files). VALUE is
 * the wanted error of "blocks", the threshold of "hierarchical" or the photographs of "optical". Prints a line of
 * tab-separated values for each: scene, grid, scheme, value, patterns, looks and sums among them, seconds on a 30 fps
 * camera that takes 4 exposures of each, then in percent how far T is from the exact one in what it predicts of the
 * four pictures driven, and how far their compensation is from the target in the room. Pictures: coffee (a photograph,
 * with CLT_SHARED), fields of 8 cells, random, one half white; each compressed to 0.4..1. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "counterlight/counterlight.h"

enum { PICTURES = 4, EXPOSURES = 4, FPS = 30 };

static void need(clt_status status, const clt_error *error) {
  if (status != CLT_OK) {
    fprintf(stderr, "%s\n", error->message);
    exit(1);
  }
}

/* The scene file with another grid, under a temporary name. */
static void write_scene(const char *folder, const char *scene, int width, int height, char path[CLT_PATH_MAX]) {
  char from[CLT_PATH_MAX], text[16384];
  snprintf(from, sizeof from, "%s/%s.cfg", folder, scene);
  FILE *in = fopen(from, "r");
  size_t size = in != NULL ? fread(text, 1, sizeof text - 1, in) : 0;
  text[size] = '\0';
  char *grid = strstr(text, "\ngrid ="), *rest = grid != NULL ? strchr(grid, '}') : NULL;
  snprintf(path, CLT_PATH_MAX, "/tmp/bench-schemes-XXXXXX");
  int file = mkstemp(path);
  FILE *out = file >= 0 ? fdopen(file, "w") : NULL;
  if (rest == NULL || out == NULL) {
    fprintf(stderr, "%s: no such scene, or no room for a copy\n", from);
    exit(1);
  }
  fclose(in);
  *grid = '\0';
  fprintf(out, "%s\ngrid = { width = %d; height = %d; channels = 3; %s", text, width, height, rest);
  fclose(out);
}

static double hash(size_t k) {
  return (double)((k * 2654435761u + 12345u) % 65521u) / 65521.0;
}

static bool draw_picture(int picture, int width, int height, clt_image *image) {
  clt_error error = {0};
  clt_image file = {0}, resized = {0};
  need(clt_image_init(image, 3, height, width, &error), &error);
  const char *shared = getenv("CLT_SHARED");
  if (picture == 0) {
    char path[CLT_PATH_MAX];
    snprintf(path, sizeof path, "%s/data/coffee.png", shared != NULL ? shared : "");
    if (shared == NULL || clt_image_read(path, NULL, &file, &error) != CLT_OK) {
      return false;
    }
    need(clt_image_resize(&file, height, width, &resized, &error), &error);
  }
  for (size_t k = 0; k < clt_image_size(image); k++) {
    size_t x = k % (size_t)width, y = k / (size_t)width % (size_t)height;
    const double plain[PICTURES] = {picture == 0 ? (double)resized.data[k] : 0, (double)((x / 8 + y / 8) % 2), hash(k),
                                    x < (size_t)width / 2};
    image->data[k] = (float)(0.4 + 0.6 * plain[picture]);
  }
  clt_image_finish(&file);
  clt_image_finish(&resized);
  return true;
}

static double distance(const clt_image *a, const clt_image *b) {
  double apart = 0, size = 0;
  for (size_t k = 0; k < clt_image_size(a); k++) {
    double difference = (double)a->data[k] - (double)b->data[k];
    apart += difference * difference;
    size += (double)b->data[k] * (double)b->data[k];
  }
  return sqrt(apart / size);
}

static double forward_error(const clt_scene *scene, const clt_transport *transport, const clt_image *picture) {
  clt_error error = {0};
  clt_image ours = {0}, exact = {0};
  need(clt_predict(transport, picture, &ours, &error), &error);
  need(clt_scene_appearance(scene, picture, &exact, &error), &error);
  double apart = distance(&ours, &exact);
  clt_image_finish(&ours);
  clt_image_finish(&exact);
  return apart;
}

/* The target: every cell as bright as under white light of half power, times the picture. */
static void make_target(const clt_scene *scene, const clt_image *picture, clt_image *target) {
  clt_error error = {0};
  clt_image white = {0};
  need(clt_image_init(&white, picture->channels, picture->height, picture->width, &error), &error);
  for (size_t k = 0; k < clt_image_size(&white); k++) {
    white.data[k] = 0.5f;
  }
  need(clt_scene_appearance(scene, &white, target, &error), &error);
  for (size_t k = 0; k < clt_image_size(&white); k++) {
    target->data[k] *= picture->data[k];
  }
  clt_image_finish(&white);
}

static double compensated_error(const clt_scene *scene, const clt_transport *transport,
                                const clt_certificate *certificate, const clt_image *picture) {
  clt_error error = {0};
  clt_image drive = {0}, target = {0}, seen = {0};
  clt_compensation result;
  const clt_white white = {.kind = CLT_WHITE_VALUE, .value = 1};
  const clt_solve_options options = {.tolerance = 1e-3};
  make_target(scene, picture, &target);
  need(clt_compensate(transport, certificate, &target, &white, &options, false, &drive, &result, &error), &error);
  need(clt_scene_appearance(scene, &drive, &seen, &error), &error);
  double apart = distance(&seen, &target);
  clt_image_finish(&drive);
  clt_image_finish(&target);
  clt_image_finish(&seen);
  return apart;
}

static void judge(const clt_scene *scene, const clt_transport *transport) {
  clt_error error = {0};
  clt_transport_info info = clt_transport_describe(transport);
  clt_certificate *certificate = NULL;
  need(clt_certify(transport, &certificate, &error), &error);
  double forward[PICTURES], compensated[PICTURES];
  for (int k = 0; k < PICTURES; k++) {
    clt_image picture = {0};
    bool drawn = draw_picture(k, info.width, info.height, &picture);
    forward[k] = drawn ? forward_error(scene, transport, &picture) : NAN;
    compensated[k] = drawn ? compensated_error(scene, transport, certificate, &picture) : NAN;
    clt_image_finish(&picture);
  }
  for (int k = 0; k < 2 * PICTURES; k++) {
    printf("\t%.2f", 100 * (k < PICTURES ? forward[k] : compensated[k - PICTURES]));
  }
  clt_certificate_destroy(certificate);
}

static void print_head(const char *scene, const clt_rig_info *info, const char *scheme, const char *value, int patterns,
                       int looks) {
  printf("%s\t%dx%d\t%s\t%s\t%d\t%d\t%.0f", scene, info->width, info->height, scheme, value != NULL ? value : "-",
         patterns, looks, (double)patterns * EXPOSURES / FPS);
}

/* Counts the patterns that only watch the room. */
static bool count_looks(void *context, const clt_progress *progress) {
  *(int *)context += strcmp(progress->phase, "look") == 0 || strcmp(progress->phase, "sum") == 0;
  return true;
}

static void measure(const clt_station *station, const clt_acquire_options *defaults, const char *scene,
                    const char *scheme, const char *value) {
  clt_error error = {0};
  int looks = 0;
  clt_acquire_options options = *defaults;
  options.scheme = scheme;
  options.progress = count_looks;
  options.context = &looks;
  options.error = value != NULL ? atof(value) : 0;
  options.threshold = value != NULL && strcmp(scheme, "hierarchical") == 0 ? atof(value) : 0;
  clt_transport *transport = NULL;
  clt_rig_info info;
  station->rig->operations->describe(station->rig, &info);
  need(clt_acquire(station->rig, &options, &transport, &error), &error);
  print_head(scene, &info, scheme, value, clt_transport_origin(transport)->patterns, looks);
  judge(station->scene, transport);
  printf("\t%.2f\t%.0f\n", 100 * clt_transport_origin(transport)->error,
         (double)clt_transport_describe(transport).bytes / 1048576);
  clt_transport_destroy(transport);
}

/* The photographs of the picture that takes most. */
static void solve_optically(const clt_station *station, const char *scene, const char *value) {
  clt_error error = {0};
  double after[PICTURES];
  int most = 0;
  clt_rig_info info;
  station->rig->operations->describe(station->rig, &info);
  for (int k = 0; k < PICTURES; k++) {
    clt_image picture = {0}, target = {0}, drive = {0}, seen = {0};
    const clt_optical_options options = {.photographs = value != NULL ? atoi(value) : 0,
                                         .white = {.kind = CLT_WHITE_VALUE, .value = 1}};
    clt_optical_result result;
    after[k] = NAN;
    if (draw_picture(k, info.width, info.height, &picture)) {
      make_target(station->scene, &picture, &target);
      need(clt_optical_compensate(station->rig, &target, &options, &drive, &result, &error), &error);
      need(clt_scene_appearance(station->scene, &drive, &seen, &error), &error);
      after[k] = distance(&seen, &target);
      most = result.photographs > most ? result.photographs : most;
    }
    clt_image_finish(&picture);
    clt_image_finish(&target);
    clt_image_finish(&drive);
    clt_image_finish(&seen);
  }
  print_head(scene, &info, "optical", value, most, 0);
  printf("\t-\t-\t-\t-");
  for (int k = 0; k < PICTURES; k++) {
    printf("\t%.2f", 100 * after[k]);
  }
  printf("\t-\t0\n");
}

static void run(const char *path, const char *scene, char *scheme) {
  clt_error error = {0};
  clt_station_config config;
  clt_station station;
  char *value = strchr(scheme, ':');
  if (value != NULL) {
    *value++ = '\0';
  }
  need(clt_station_for_scene(path, &config, &error), &error);
  need(clt_station_open(&config, &station, &error), &error);
  need(clt_station_open_rig(&config, &station, NULL, &error), &error);
  if (strcmp(scheme, "optical") == 0) {
    solve_optically(&station, scene, value);
  } else {
    measure(&station, &config.acquire, scene, scheme, value);
  }
  fflush(stdout);
  clt_station_close(&station);
}

int main(int count, char **words) {
  if (count < 6) {
    fprintf(stderr, "usage: bench_schemes SCENES SCENE WIDTH HEIGHT SCHEME[:VALUE] ...\n");
    return 2;
  }
  char path[CLT_PATH_MAX];
  write_scene(words[1], words[2], atoi(words[3]), atoi(words[4]), path);
  for (int k = 5; k < count; k++) {
    run(path, words[2], words[k]);
  }
  unlink(path);
  return 0;
}
