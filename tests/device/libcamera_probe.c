/* Checks one camera of libcamera in the guest: libcamera_probe DEVICE CHECK[=ARGUMENT]... Exit 0 where all hold.
 *
 *   frames           whole, in order, none from the future
 *   exposure=NODE    the first frame after setting has the light of it, NODE's driver has it, automatic exposure is off
 *   cycles           ten of opening, taking and closing leave no descriptor and no thread
 *   unplug=PID       ends PID, which must make the camera go, and once only; opening it again finds nothing
 *   return           opens it as soon as it is there, and takes a frame */
#include <dirent.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "base/clock.h"
#include "device/camera/libcamera.h"

enum { CYCLES = 10, FRAMES = 12 };
enum { WIDTH = 720, HEIGHT = 480 }; /* vimc takes multiples of 6 */
#define TIMEOUT_S 10.0
/* The simulated camera sees a radiance of 1 everywhere: so much of full scale in a second, and codes are whole. */
#define SENSITIVITY 20.0
#define LIGHT_TOLERANCE 0.003
#define PLUGGED_S 30.0

static void must(bool holds, const char *format, ...) CLT_PRINTF(2, 3);
static void must(bool holds, const char *format, ...) {
  if (!holds) {
    va_list arguments;
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
    putchar('\n');
    exit(1);
  }
}

static int count_entries(const char *folder) {
  int count = 0;
  DIR *directory = opendir(folder);
  must(directory != NULL, "%s cannot be read", folder);
  while (readdir(directory) != NULL) {
    count++;
  }
  closedir(directory);
  return count;
}

static clt_status try_open(const char *device, clt_camera **camera, clt_error *error) {
  clt_camera_config config = {
      .format = "auto", .width = WIDTH, .height = HEIGHT, .gain = -1, .focus = -1, .power_line_hz = -1};
  snprintf(config.device, sizeof config.device, "%s", device);
  return clt_libcamera_camera_open(&config, camera, error);
}

static clt_camera *open_camera(const char *device) {
  clt_camera *camera = NULL;
  clt_error error = {0};
  must(try_open(device, &camera, &error) == CLT_OK, "open: %s", error.message);
  return camera;
}

static clt_frame take(clt_camera *camera, int64_t not_before_ns) {
  clt_frame frame;
  clt_error error = {0};
  must(camera->driver->next(camera, not_before_ns, TIMEOUT_S, &frame, &error) == CLT_OK, "next: %s", error.message);
  must(frame.exposed_ns >= not_before_ns, "the frame began %.3f ms too early",
       1e-6 * (double)(not_before_ns - frame.exposed_ns));
  must(frame.exposed_ns <= clt_clock_ns(), "the frame begins in the future");
  return frame;
}

static void check_frames(const char *device, const char *unused) {
  (void)unused;
  clt_camera *camera = open_camera(device);
  clt_camera_info info;
  camera->driver->describe(camera, &info);
  clt_frame first = take(camera, 0), frame = first;
  for (int k = 1; k < FRAMES; k++) {
    clt_frame before = frame;
    frame = take(camera, frame.exposed_ns + 1);
    must(frame.sequence > before.sequence, "frame %u came after %u", frame.sequence, before.sequence);
    must(frame.width == info.width && frame.height == info.height && frame.channels == info.channels &&
             frame.bits == info.bits,
         "the frame is none of the camera's");
  }
  double frame_s = 1e-9 * (double)(frame.exposed_ns - first.exposed_ns) / (frame.sequence - first.sequence);
  printf("%d x %d x %d, %d bits, %.2f ms a frame, announced %.2f\n", info.width, info.height, info.channels, info.bits,
         1e3 * frame_s, 1e3 * info.frame_s);
  /* a busy machine's cameras are slow, and unevenly so */
  must(frame_s > 0 && info.frame_s > 0, "frames have no distance");
  camera->driver->close(camera);
}

static int read_control(const char *node, unsigned id) {
  struct v4l2_control control = {.id = id};
  int descriptor = open(node, O_RDWR | O_CLOEXEC);
  must(descriptor >= 0 && ioctl(descriptor, VIDIOC_G_CTRL, &control) == 0, "%s: control %x cannot be read", node, id);
  close(descriptor);
  return control.value;
}

/* Of full scale, over all samples. */
static double mean_of(const clt_frame *frame) {
  size_t count = (size_t)frame->width * (size_t)frame->height * (size_t)frame->channels;
  double sum = 0;
  for (size_t k = 0; k < count; k++) {
    sum += frame->samples[k];
  }
  return sum / (double)count / ((1 << frame->bits) - 1);
}

static void check_exposure(const char *device, const char *node) {
  static const double asked_s[] = {0.002, 0.0123, 0.0333, 0.0001, 0.01234};
  clt_camera *camera = open_camera(device);
  for (size_t k = 0; k < sizeof asked_s / sizeof asked_s[0]; k++) {
    clt_error error = {0};
    must(camera->driver->set_exposure(camera, asked_s[k], &error) == CLT_OK, "set: %s", error.message);
    clt_frame frame = take(camera, clt_clock_ns());
    int units = read_control(node, V4L2_CID_EXPOSURE_ABSOLUTE);
    printf("asked %.6f s, frame %.6f s, driver %d x 100 us, light %.4f\n", asked_s[k], frame.exposure_s, units,
           mean_of(&frame));
    must(fabs(mean_of(&frame) - SENSITIVITY * frame.exposure_s) < LIGHT_TOLERANCE,
         "the first frame does not have the light of its exposure");
    must(fabs(frame.exposure_s - 1e-4 * units) < 1e-9, "the frame's exposure is not the driver's");
    must(fabs(frame.exposure_s - asked_s[k]) <= 0.5e-4 + 1e-9, "the exposure is not what was asked for");
    must(read_control(node, V4L2_CID_EXPOSURE_AUTO) == V4L2_EXPOSURE_MANUAL, "automatic exposure is on");
  }
  clt_error error = {0};
  must(camera->driver->set_exposure(camera, 1e3, &error) == CLT_BAD_INPUT, "an exposure of 1000 s is not refused");
  camera->driver->close(camera);
}

static void check_cycles(const char *device, const char *unused) {
  (void)unused;
  int descriptors = 0, threads = 0;
  for (int k = 0; k <= CYCLES; k++) {
    clt_camera *camera = open_camera(device);
    take(camera, clt_clock_ns());
    camera->driver->close(camera);
    descriptors = k == 0 ? count_entries("/proc/self/fd") : descriptors;
    threads = k == 0 ? count_entries("/proc/self/task") : threads;
  }
  printf("descriptors %d -> %d, threads %d -> %d\n", descriptors, count_entries("/proc/self/fd"), threads,
         count_entries("/proc/self/task"));
  must(count_entries("/proc/self/fd") == descriptors, "descriptors are left open");
  must(count_entries("/proc/self/task") == threads, "threads are left");
}

static void check_unplug(const char *device, const char *pid) {
  int descriptors = 0;
  clt_camera *camera = open_camera(device);
  camera->driver->close(camera);
  descriptors = count_entries("/proc/self/fd");
  camera = open_camera(device);
  take(camera, clt_clock_ns());
  kill(atoi(pid), SIGTERM);
  clt_frame frame;
  clt_error error = {0};
  clt_status status = CLT_OK;
  int64_t start_ns = clt_clock_ns();
  while (status == CLT_OK) {
    status = camera->driver->next(camera, 0, TIMEOUT_S, &frame, &error);
  }
  printf("%s after %.2f s: %s\n", clt_status_name(status), clt_clock_since(start_ns), error.message);
  must(status == CLT_GONE, "an unplugged camera is not gone");
  must(camera->driver->next(camera, 0, TIMEOUT_S, &frame, &error) == CLT_GONE, "a camera that has gone is back");
  camera->driver->close(camera);
  must(try_open(device, &camera, &error) == CLT_GONE, "it opens, or fails otherwise: %s", error.message);
  must(count_entries("/proc/self/fd") == descriptors, "descriptors are left open");
}

static void check_return(const char *device, const char *unused) {
  (void)unused;
  clt_camera *camera = NULL;
  clt_error error = {0};
  int64_t start_ns = clt_clock_ns();
  clt_status status;
  while ((status = try_open(device, &camera, &error)) == CLT_GONE && clt_clock_since(start_ns) < PLUGGED_S) {
    usleep(100000);
  }
  must(status == CLT_OK, "open: %s", error.message);
  take(camera, clt_clock_ns());
  printf("back after %.2f s\n", clt_clock_since(start_ns));
  camera->driver->close(camera);
}

static const struct {
  const char *name;
  void (*run)(const char *device, const char *argument);
} checks[] = {{"frames", check_frames},
              {"exposure", check_exposure},
              {"cycles", check_cycles},
              {"unplug", check_unplug},
              {"return", check_return}};

static void run_check(const char *device, const char *word) {
  size_t length = strcspn(word, "=");
  for (size_t k = 0; k < sizeof checks / sizeof checks[0]; k++) {
    if (strlen(checks[k].name) == length && strncmp(checks[k].name, word, length) == 0) {
      printf("%s, %s: ", device, checks[k].name);
      checks[k].run(device, word[length] == '=' ? word + length + 1 : "");
      return;
    }
  }
  must(false, "there is no check %s", word);
}

int main(int count, char **words) {
  setvbuf(stdout, NULL, _IOLBF, 0);
  for (int k = 2; k < count; k++) {
    run_check(words[1], words[k]);
  }
  return 0;
}
