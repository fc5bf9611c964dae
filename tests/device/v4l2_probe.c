/* Drives one Video4Linux camera by lines of text, for the tests in the guest: one command a line on stdin, one JSON
 * object a line on stdout.
 *
 *   open DEVICE FORMAT WIDTH HEIGHT RATE GAIN WHITE FOCUS LINE          (a space in FORMAT is written "_")
 *   expose SECONDS | next NOT_BEFORE_NS TIMEOUT_S [FILE] | close | list | self
 *   press CONTROL                    (the camera's own test buttons, which its priority keeps from other programs) */
#include <dirent.h>
#include <inttypes.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "base/clock.h"
#include "device/camera/v4l2.h"
#include "device/camera/v4l2_list.h"

static int count_entries(const char *folder) {
  int count = 0;
  DIR *directory = opendir(folder);
  for (struct dirent *entry; directory != NULL && (entry = readdir(directory)) != NULL;) {
    count += entry->d_name[0] != '.';
  }
  if (directory != NULL) {
    closedir(directory);
  }
  return count;
}

static int count_mappings(void) {
  char line[512];
  int count = 0;
  FILE *file = fopen("/proc/self/maps", "re");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    count += strstr(line, "/dev/video") != NULL;
  }
  if (file != NULL) {
    fclose(file);
  }
  return count;
}

static long resident_kib(void) {
  long pages = 0, resident = 0;
  FILE *file = fopen("/proc/self/statm", "re");
  if (file == NULL || fscanf(file, "%ld %ld", &pages, &resident) != 2) {
    resident = -1;
  }
  if (file != NULL) {
    fclose(file);
  }
  return resident * sysconf(_SC_PAGESIZE) / 1024;
}

static void tell_self(void) {
  printf("{\"fds\": %d, \"threads\": %d, \"mappings\": %d, \"rss_kib\": %ld, \"now_ns\": %" PRId64 "}\n",
         count_entries("/proc/self/fd"), count_entries("/proc/self/task"), count_mappings(), resident_kib(),
         clt_clock_ns());
}

static void tell_status(clt_status status, const clt_error *error) {
  printf("\"status\": \"%s\", \"message\": \"", clt_status_name(status));
  for (const char *c = status == CLT_OK ? "" : error->message; *c != '\0'; c++) {
    if (*c == '"' || *c == '\\') {
      putchar('\\');
    }
    putchar(*c);
  }
  printf("\"");
}

static void open_camera(const char *arguments, clt_camera **camera) {
  clt_camera_config config = {.driver = "v4l2"};
  clt_error error = {0};
  clt_camera_info info = {0};
  sscanf(arguments, "%1023s %7s %d %d %lf %lf %lf %lf %d", config.device, config.format, &config.width, &config.height,
         &config.rate_hz, &config.gain, &config.white_balance_k, &config.focus, &config.power_line_hz);
  for (char *c = strchr(config.format, '_'); c != NULL; c = strchr(c, '_')) {
    *c = ' ';
  }
  clt_status status = clt_v4l2_open(&config, camera, &error);
  if (status == CLT_OK) {
    (*camera)->driver->describe(*camera, &info);
  }
  printf("{");
  tell_status(status, &error);
  printf(
      ", \"width\": %d, \"height\": %d, \"channels\": %d, \"bits\": %d, \"frame_s\": %.9g, \"exposure_min_s\": %.9g, "
      "\"exposure_max_s\": %.9g}\n",
      info.width, info.height, info.channels, info.bits, info.frame_s, info.exposure_min_s, info.exposure_max_s);
}

static void save(const clt_frame *frame, const char *path) {
  FILE *file = fopen(path, "wb");
  size_t values = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
  if (file == NULL || fwrite(frame->samples, sizeof *frame->samples, values, file) != values || fclose(file) != 0) {
    fprintf(stderr, "%s: cannot be written\n", path);
    exit(1);
  }
}

static void take(const char *arguments, clt_camera *camera) {
  clt_frame frame = {0};
  clt_error error = {0};
  char path[512] = "";
  int64_t not_before_ns = 0, start_ns = clt_clock_ns();
  double timeout_s = 0;
  sscanf(arguments, "%" SCNd64 " %lf %511s", &not_before_ns, &timeout_s, path);
  clt_status status = camera->driver->next(camera, not_before_ns, timeout_s, &frame, &error);
  if (status == CLT_OK && path[0] != '\0') {
    save(&frame, path);
  }
  printf("{");
  tell_status(status, &error);
  printf(", \"exposed_ns\": %" PRId64 ", \"exposure_s\": %.9g, \"sequence\": %u, \"took_s\": %.6f}\n", frame.exposed_ns,
         frame.exposure_s, frame.sequence, clt_clock_since(start_ns));
}

static void tell_camera(const clt_v4l2_camera *camera) {
  printf("{\"node\": \"%s\", \"stable\": \"%s\", \"card\": \"%s\", \"driver\": \"%s\", \"usb_mbit_s\": %g, \"status\": "
         "\"%s\", \"offers\": {",
         camera->node, camera->stable, camera->card, camera->driver, camera->usb_mbit_s,
         clt_status_name(camera->status));
  for (int k = 0; k < camera->offer_count; k++) {
    const clt_v4l2_offer *offer = &camera->offers[k];
    printf("%s\"%s\": {\"decoded\": %s, \"depth\": %d, \"sizes\": %d, \"rate\": %g}", k > 0 ? ", " : "", offer->code,
           offer->decoded ? "true" : "false", offer->depth, offer->size_count,
           offer->size_count > 0 ? offer->sizes[0].rate_high_hz : 0);
  }
  printf("}, \"settings\": {");
  for (int k = 0; k < camera->setting_count; k++) {
    const clt_v4l2_setting *setting = &camera->settings[k];
    printf("%s\"%08x\": {\"name\": \"%s\", \"value\": %" PRId64 ", \"automatic\": %s, \"on\": %s}", k > 0 ? ", " : "",
           setting->id, setting->name, setting->value, setting->automatic ? "true" : "false",
           setting->on ? "true" : "false");
  }
  printf("}}");
}

static void list(void) {
  clt_v4l2_cameras cameras;
  clt_error error = {0};
  printf("{");
  tell_status(clt_v4l2_list(&cameras, &error), &error);
  printf(", \"cameras\": [");
  for (int k = 0; k < cameras.count; k++) {
    printf("%s", k > 0 ? ", " : "");
    tell_camera(&cameras.camera[k]);
  }
  printf("]}\n");
  clt_v4l2_cameras_finish(&cameras);
}

/* Through the driver's own descriptor. */
static void press(const char *arguments) {
  struct v4l2_control control = {.id = (uint32_t)strtoul(arguments, NULL, 10), .value = 1};
  bool pressed = false;
  for (int fd = 3; fd < 64 && !pressed; fd++) {
    char link[32], path[64] = "";
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    pressed = readlink(link, path, sizeof path - 1) > 0 && strncmp(path, "/dev/video", 10) == 0 &&
              ioctl(fd, VIDIOC_S_CTRL, &control) == 0;
  }
  printf("{\"status\": \"%s\"}\n", pressed ? "ok" : "failed");
}

static void expose(const char *arguments, clt_camera *camera) {
  clt_error error = {0};
  clt_status status = camera->driver->set_exposure(camera, strtod(arguments, NULL), &error);
  printf("{");
  tell_status(status, &error);
  printf("}\n");
}

int main(void) {
  char line[2048];
  clt_camera *camera = NULL;
  setvbuf(stdout, NULL, _IOLBF, 0);
  while (fgets(line, sizeof line, stdin) != NULL) {
    if (strncmp(line, "open ", 5) == 0 && camera == NULL) {
      open_camera(line + 5, &camera);
    } else if (strncmp(line, "expose ", 7) == 0 && camera != NULL) {
      expose(line + 7, camera);
    } else if (strncmp(line, "next ", 5) == 0 && camera != NULL) {
      take(line + 5, camera);
    } else if (strncmp(line, "close", 5) == 0 && camera != NULL) {
      camera->driver->close(camera);
      camera = NULL;
      printf("{\"status\": \"ok\"}\n");
    } else if (strncmp(line, "press ", 6) == 0) {
      press(line + 6);
    } else if (strncmp(line, "list", 4) == 0) {
      list();
    } else if (strncmp(line, "self", 4) == 0) {
      tell_self();
    } else {
      printf("{\"status\": \"bad-input\", \"message\": \"%s camera\"}\n", camera != NULL ? "open" : "no");
    }
  }
  if (camera != NULL) {
    camera->driver->close(camera);
  }
  return 0;
}
