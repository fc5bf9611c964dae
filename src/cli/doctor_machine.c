/* Memory, processor, disk, and what the program is linked with. */
#include <cblas.h>
#include <gnu/libc-version.h>
#include <hdf5.h>
#include <libconfig.h>
#include <stdio.h>
#include <string.h>
#include <sys/statvfs.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "base/file.h"
#include "base/places.h"
#include "base/settings.h"
#include "cli/doctor.h"
#ifdef CLT_HAVE_LIBCAMERA
#include "device/camera/libcamera_list.h"
#endif

#define MIB 1048576.0
/* A transport of 64 x 64 cells takes 200 MB as it is measured, its inverse as much. */
enum { MEMORY_LEAST_MIB = 1024, DISK_LEAST_MIB = 1024, DISK_NEEDED_MIB = 100 };

/* A line of /proc/meminfo, MiB; 0 where there is none. */
static double memory_mib(const char *name) {
  char line[128];
  long long kib = 0;
  FILE *file = fopen("/proc/meminfo", "re");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    if (strncmp(line, name, strlen(name)) == 0) {
      sscanf(line + strlen(name), " %lld", &kib);
    }
  }
  if (file != NULL) {
    fclose(file);
  }
  return (double)kib / 1024;
}

static void look_at_memory(doctor *self) {
  double total = memory_mib("MemTotal:"), available = memory_mib("MemAvailable:");
  bool enough = available >= MEMORY_LEAST_MIB;
  doctor_find(self, enough ? DOCTOR_GOOD : DOCTOR_WARNING,
              enough ? NULL : "a coarser grid, or more memory: a dense transport takes 12 (cells)^2 bytes",
              "memory: %.1f GB, of which %.1f free", total * MIB * 1e-9, available * MIB * 1e-9);
  json_object_set_new(self->document, "memory",
                      json_pack("{s:f, s:f}", "total_mib", total, "available_mib", available));
}

static void look_at_processor(doctor *self) {
  long cores = sysconf(_SC_NPROCESSORS_ONLN);
#if defined(__x86_64__) || defined(__i386__)
  bool avx2 = __builtin_cpu_supports("avx2") != 0;
  doctor_find(self, avx2 ? DOCTOR_GOOD : DOCTOR_WARNING,
              avx2 ? NULL : "a processor with AVX2 (made since 2013) solves several times faster",
              "processor: %ld cores, %s", cores, avx2 ? "AVX2" : "no AVX2");
  json_object_set_new(self->document, "processor", json_pack("{s:I, s:b}", "cores", (json_int_t)cores, "avx2", avx2));
#else
  doctor_find(self, DOCTOR_NOTE, NULL, "processor: %ld cores; the products are written for AVX2 and run plain here",
              cores);
  json_object_set_new(self->document, "processor", json_pack("{s:I, s:b}", "cores", (json_int_t)cores, "avx2", 0));
#endif
}

/* The state directory of the configuration's section daemon, else the usual one. */
static clt_status find_state(const doctor *self, char *out, clt_error *error) {
  clt_settings *settings = NULL;
  char folder[CLT_PATH_MAX] = ".";
  out[0] = '\0';
  if (self->configured && clt_settings_open(self->path, &settings, NULL) == CLT_OK) {
    clt_section section = clt_section_group(clt_settings_root(settings), "daemon");
    const char *text = clt_read_text(section, "state", "", CLT_PATH_MAX - 1);
    clt_file_folder(self->path, folder);
    if (text[0] != '\0' && clt_file_join(folder, text, out, NULL) != CLT_OK) {
      out[0] = '\0';
    }
  }
  clt_settings_close(settings);
  return out[0] != '\0' ? CLT_OK : clt_place_state(out, error);
}

/* The state directory may not be there yet: then the nearest folder above it counts. */
static void look_at_disk(doctor *self) {
  char state[CLT_PATH_MAX], at[CLT_PATH_MAX];
  clt_error error = {0};
  struct statvfs disk;
  if (find_state(self, state, &error) != CLT_OK) {
    doctor_find(self, DOCTOR_NOTE, NULL, "%s", error.message);
    return;
  }
  snprintf(at, sizeof at, "%s", state);
  while (access(at, F_OK) != 0 && strlen(at) > 1) {
    char above[CLT_PATH_MAX];
    clt_file_folder(at, above);
    memcpy(at, above, sizeof at);
  }
  if (statvfs(at, &disk) != 0) {
    return;
  }
  double free_mib = (double)disk.f_bavail * (double)disk.f_frsize / MIB;
  bool enough = free_mib >= DISK_LEAST_MIB;
  doctor_find(self,
              enough                        ? DOCTOR_GOOD
              : free_mib >= DISK_NEEDED_MIB ? DOCTOR_WARNING
                                            : DOCTOR_PROBLEM,
              enough ? NULL : "make room: transports and journals are written there",
              "state directory %s: %.1f GB free%s", state, free_mib * MIB * 1e-9,
              access(state, F_OK) == 0 ? "" : " (it is made at the first start)");
  json_object_set_new(self->document, "state", json_pack("{s:s, s:f}", "path", state, "free_mib", free_mib));
}

static void look_at_versions(doctor *self) {
  struct utsname kernel = {0};
  unsigned major = 0, minor = 0, release = 0;
  char hdf5[40], config[40];
  uname(&kernel);
  H5get_libversion(&major, &minor, &release);
  snprintf(hdf5, sizeof hdf5, "%u.%u.%u", major, minor, release);
  snprintf(config, sizeof config, "%d.%d.%d", LIBCONFIG_VER_MAJOR, LIBCONFIG_VER_MINOR, LIBCONFIG_VER_REVISION);
  json_t *versions = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:s}", "counterlight", CLT_VERSION, "linux",
                               kernel.release, "libc", gnu_get_libc_version(), "hdf5", hdf5, "openblas",
                               openblas_get_config(), "libconfig", config, "jansson", jansson_version_str());
#ifdef CLT_HAVE_LIBCAMERA
  json_object_set_new(versions, "libcamera", json_string(clt_libcamera_version()));
#endif
  doctor_find(self, DOCTOR_GOOD, NULL, "counterlight %s on Linux %s, HDF5 %s, %s", CLT_VERSION, kernel.release, hdf5,
              openblas_get_config());
  json_object_set_new(self->document, "versions", versions);
}

void doctor_look_at_machine(doctor *self) {
  look_at_memory(self);
  look_at_processor(self);
  look_at_disk(self);
  look_at_versions(self);
}
