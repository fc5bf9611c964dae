#include "acquire/group.h"

#include <math.h>
#include <string.h>

clt_status clt_group_init(clt_group *group, int channels, int height, int width, clt_error *error) {
  *group = (clt_group){0};
  clt_image *const images[] = {&group->drive, &group->light, &group->variance};
  clt_status status = CLT_OK;
  for (size_t i = 0; status == CLT_OK && i < sizeof images / sizeof images[0]; i++) {
    status = clt_image_init(images[i], channels, height, width, error);
  }
  return status;
}

void clt_group_finish(clt_group *group) {
  clt_image_finish(&group->drive);
  clt_image_finish(&group->light);
  clt_image_finish(&group->variance);
}

void clt_group_clear(clt_group *group) {
  const size_t bytes = clt_image_size(&group->drive) * sizeof *group->drive.data;
  group->count = 0;
  group->weight = group->size = 0;
  memset(group->drive.data, 0, bytes);
  memset(group->light.data, 0, bytes);
  memset(group->variance.data, 0, bytes);
}

bool clt_group_is_drive(const clt_group *group) {
  for (size_t i = 0; i < clt_image_size(&group->drive); i++) {
    if (group->drive.data[i] != 0 && group->drive.data[i] != 1) {
      return false;
    }
  }
  return true;
}

double clt_group_fit(const clt_group *group, const clt_image *drive) {
  bool apart = true, within = true;
  for (size_t i = 0; i < clt_image_size(drive); i++) {
    apart = apart && !(drive->data[i] > 0 && group->drive.data[i] > 0);
    within = within && drive->data[i] <= group->drive.data[i];
  }
  return apart ? 1 : within ? -1 : 0;
}

bool clt_group_is_full(const clt_group *group, const clt_image *black_variance) {
  double own = 0, black = 0;
  for (size_t i = 0; i < clt_image_size(black_variance); i++) {
    if (isfinite(group->variance.data[i]) && isfinite(black_variance->data[i])) {
      own += (double)group->variance.data[i];
      black += (double)black_variance->data[i];
    }
  }
  return group->weight * group->weight * black > own;
}

void clt_group_add(clt_group *group, double weight, const clt_image *drive, const clt_image *seen,
                   const clt_image *deviation, const clt_image *black) {
  const float w = (float)weight;
  for (size_t i = 0; i < clt_image_size(drive); i++) {
    group->drive.data[i] += w * drive->data[i];
    group->light.data[i] += w * (seen->data[i] - black->data[i]);
    group->variance.data[i] += w * w * deviation->data[i] * deviation->data[i];
  }
  group->count++;
  group->weight += weight;
  group->size += fabs(weight);
}

/* With b = black + e, light misses weight x e and the photograph's own black e. */
void clt_group_expect(clt_group *group, const clt_image *black, const clt_image *black_variance, double rounding) {
  const float error = (float)(group->weight - 1), together = (float)(group->size * rounding);
  for (size_t i = 0; i < clt_image_size(black); i++) {
    group->light.data[i] += black->data[i];
    group->variance.data[i] += error * error * black_variance->data[i] + together * together;
  }
}

bool clt_group_alike(const clt_group *group, const clt_group *other) {
  const size_t bytes = clt_image_size(&group->drive) * sizeof *group->drive.data;
  return group->count == other->count && memcmp(group->drive.data, other->drive.data, bytes) == 0;
}
