#include "device/camera/v4l2_find.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NODES "/sys/class/video4linux"
#define BY_ID "/dev/v4l/by-id"

static int compare(const void *left, const void *right) {
  return *(const int *)left - *(const int *)right;
}

void clt_v4l2_nodes_read(clt_v4l2_nodes *nodes) {
  *nodes = (clt_v4l2_nodes){0};
  DIR *folder = opendir(NODES);
  for (struct dirent *entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
    int number = 0, used = 0;
    if (sscanf(entry->d_name, "video%d%n", &number, &used) == 1 && entry->d_name[used] == '\0' &&
        nodes->count < CLT_V4L2_NODES_MAX) {
      nodes->number[nodes->count++] = number;
    }
  }
  if (folder != NULL) {
    closedir(folder);
  }
  qsort(nodes->number, (size_t)nodes->count, sizeof nodes->number[0], compare);
}

/* The first line of a file of sysfs; empty where it is not there. */
static void read_line(const char *folder, const char *name, char *line, size_t size) {
  char path[PATH_MAX + 32];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  line[0] = '\0';
  FILE *file = fopen(path, "re");
  if (file != NULL) {
    if (fgets(line, (int)size, file) == NULL) {
      line[0] = '\0';
    }
    fclose(file);
  }
  line[strcspn(line, "\n")] = '\0';
}

bool clt_v4l2_usb_of_node(int number, clt_usb_id *usb, double *mbit_s) {
  char link[64], folder[PATH_MAX], text[32] = "";
  *usb = (clt_usb_id){.vendor = -1, .product = -1};
  snprintf(link, sizeof link, NODES "/video%d/device", number);
  if (realpath(link, folder) == NULL) {
    return false;
  }
  /* The node hangs on an interface of the device, one folder below it. */
  char *end = strrchr(folder, '/');
  if (end == NULL) {
    return false;
  }
  *end = '\0';
  read_line(folder, "idVendor", text, sizeof text);
  if (text[0] == '\0') {
    return false;
  }
  usb->vendor = (int)strtol(text, NULL, 16);
  read_line(folder, "idProduct", text, sizeof text);
  usb->product = (int)strtol(text, NULL, 16);
  read_line(folder, "serial", usb->serial, sizeof usb->serial);
  read_line(folder, "speed", text, sizeof text);
  *mbit_s = strtod(text, NULL);
  snprintf(usb->port, sizeof usb->port, "%s", strrchr(folder, '/') + 1);
  return true;
}

static int node_number(const char *path) {
  int number = -1, used = 0;
  return sscanf(path, "/dev/video%d%n", &number, &used) == 1 && path[used] == '\0' ? number : -1;
}

void clt_v4l2_identify(const clt_v4l2_node *node, clt_v4l2_identity *identity) {
  char path[PATH_MAX];
  double speed = 0;
  *identity = (clt_v4l2_identity){0};
  const char *real = realpath(node->path, path);
  identity->is_usb = real != NULL && clt_v4l2_usb_of_node(node_number(real), &identity->usb, &speed);
  memcpy(identity->card, node->card, sizeof identity->card);
  memcpy(identity->bus, node->bus, sizeof identity->bus);
}

static bool same_camera(const clt_v4l2_identity *wanted, const clt_v4l2_identity *found) {
  if (wanted->is_usb != found->is_usb) {
    return false;
  }
  return wanted->is_usb ? clt_usb_matches(&wanted->usb, &found->usb)
                        : strcmp(wanted->card, found->card) == 0 && strcmp(wanted->bus, found->bus) == 0;
}

/* The cameras there are that match (all where wanted is NULL); the first is left open in node. names: all of them, for
 * a message. why: the last reason why a node that matches could not be opened. */
static int search(const clt_v4l2_identity *wanted, clt_v4l2_node *node, char *names, size_t size, clt_error *why) {
  clt_v4l2_nodes nodes;
  clt_v4l2_nodes_read(&nodes);
  *node = (clt_v4l2_node){.fd = -1};
  int found = 0;
  for (int k = 0; k < nodes.count; k++) {
    char path[64];
    clt_usb_id usb;
    double speed = 0;
    clt_v4l2_node candidate;
    clt_v4l2_identity identity;
    snprintf(path, sizeof path, "/dev/video%d", nodes.number[k]);
    bool is_usb = clt_v4l2_usb_of_node(nodes.number[k], &usb, &speed);
    if (wanted != NULL && (wanted->is_usb != is_usb || (is_usb && !clt_usb_matches(&wanted->usb, &usb)))) {
      continue;
    }
    if (clt_v4l2_node_open(path, &candidate, why) != CLT_OK) {
      continue;
    }
    clt_v4l2_identify(&candidate, &identity);
    if (wanted != NULL && !same_camera(wanted, &identity)) {
      clt_v4l2_node_close(&candidate);
      continue;
    }
    size_t used = strlen(names);
    snprintf(names + used, size - used, "%s%s", used > 0 ? ", " : "", path);
    if (found++ == 0) {
      *node = candidate;
    } else {
      clt_v4l2_node_close(&candidate);
    }
  }
  return found;
}

static clt_status one_of(const char *device, const clt_v4l2_identity *wanted, clt_v4l2_node *node, clt_error *error) {
  char names[256] = "";
  clt_error why = {0};
  int found = search(wanted, node, names, sizeof names, &why);
  if (found == 1) {
    return CLT_OK;
  }
  clt_v4l2_node_close(node);
  if (found > 1) {
    return clt_fail(error, CLT_BAD_INPUT,
                    "camera.device = \"%s\" may be any of %s; name one as `counterlight doctor` lists it", device,
                    names);
  }
  if (why.status == CLT_BAD_INPUT && strstr(why.message, "may not") != NULL) {
    return clt_fail(error, CLT_BAD_INPUT, "%s", why.message);
  }
  return clt_fail(error, CLT_GONE,
                  "there is no camera \"%s\"; plug it in, or see `counterlight doctor` for what there is", device);
}

clt_status clt_v4l2_find_again(const clt_v4l2_identity *identity, clt_v4l2_node *node, clt_error *error) {
  char text[192];
  if (identity->is_usb) {
    clt_usb_describe(&identity->usb, text, sizeof text);
  } else {
    snprintf(text, sizeof text, "%s", identity->card);
  }
  return one_of(text, identity, node, error);
}

static clt_status open_path(const char *device, clt_v4l2_node *node, clt_error *error) {
  char path[CLT_PATH_MAX + 16], real[PATH_MAX];
  snprintf(path, sizeof path, "%s%s", device[0] == '/' ? "" : BY_ID "/", device);
  if (realpath(path, real) == NULL) {
    return clt_fail(error, errno == ENOENT ? CLT_GONE : CLT_BAD_INPUT,
                    "%s: %s; plug the camera in, or see `counterlight doctor` for what there is", path,
                    strerror(errno));
  }
  return clt_v4l2_node_open(real, node, error);
}

clt_status clt_v4l2_find(const char *device, clt_v4l2_node *node, clt_v4l2_identity *identity, clt_error *error) {
  clt_status status;
  if (strcmp(device, "auto") == 0) {
    status = one_of(device, NULL, node, error);
  } else if (strncmp(device, "usb:", 4) == 0 || strncmp(device, "port:", 5) == 0) {
    clt_v4l2_identity wanted = {.is_usb = true};
    status = clt_usb_parse(device, &wanted.usb, error);
    status = status == CLT_OK ? one_of(device, &wanted, node, error) : status;
  } else {
    status = open_path(device, node, error);
  }
  if (status == CLT_OK) {
    clt_v4l2_identify(node, identity);
    if (identity->is_usb && identity->usb.serial[0] != '\0') {
      identity->usb.port[0] = '\0';
    }
  }
  return status;
}

void clt_v4l2_stable_name(const clt_v4l2_node *node, const clt_v4l2_identity *identity, char *name, size_t size) {
  const clt_usb_id *usb = &identity->usb;
  if (!identity->is_usb) {
    snprintf(name, size, "%s", node->path);
  } else if (usb->serial[0] != '\0') {
    snprintf(name, size, "usb:%04x:%04x:%s", usb->vendor, usb->product, usb->serial);
  } else {
    snprintf(name, size, "port:%s", usb->port);
  }
}
