#include "daemon/letters.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

clt_status daemon_boxes_init(daemon_boxes *boxes, clt_error *error) {
  *boxes = (daemon_boxes){.wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  if (boxes->wake < 0) {
    return clt_fail(error, CLT_FAILED, "no event descriptor for the control loop: %s", strerror(errno));
  }
  if (reel_create(&boxes->reel, error) != CLT_OK) {
    daemon_boxes_finish(boxes);
    return CLT_FAILED;
  }
  const struct {
    clt_mailbox **box;
    void (*drop)(void *letter);
  } wanted[] = {
      {&boxes->orders, free},
      {&boxes->drives, output_drive_free},
      {&boxes->patterns, output_pattern_free},
      {&boxes->answers, free},
      {&boxes->opened, free},
      {&boxes->frames, free},
      {&boxes->measure_jobs, measure_job_free},
      {&boxes->progress, free},
      {&boxes->measured, measure_result_free},
      {&boxes->solver_jobs, solver_job_free},
      {&boxes->moving_jobs, moving_job_free},
      {&boxes->moved, free},
      {&boxes->haste, free},
      {&boxes->solved, solver_result_free},
  };
  for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
    if (clt_mailbox_create(wanted[i].drop, wanted[i].box, error) != CLT_OK) {
      daemon_boxes_finish(boxes);
      return CLT_FAILED;
    }
  }
  return CLT_OK;
}

void daemon_boxes_finish(daemon_boxes *boxes) {
  clt_mailbox *all[] = {boxes->orders, boxes->drives,   boxes->patterns,     boxes->answers,  boxes->opened,
                        boxes->frames, boxes->progress, boxes->measure_jobs, boxes->measured, boxes->solver_jobs,
                        boxes->haste,  boxes->solved,   boxes->moving_jobs,  boxes->moved};
  for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
    clt_mailbox_destroy(all[i]);
  }
  reel_destroy(boxes->reel);
  if (boxes->wake >= 0) {
    close(boxes->wake);
  }
  *boxes = (daemon_boxes){.wake = -1};
}

void daemon_report(const daemon_boxes *boxes, clt_mailbox *box, void *letter) {
  clt_mailbox_put(box, letter);
  eventfd_write(boxes->wake, 1);
}

clt_status daemon_image_copy(const clt_image *from, clt_image *to, clt_error *error) {
  *to = (clt_image){0};
  if (from->data == NULL) {
    return CLT_OK;
  }
  clt_status status = clt_image_init(to, from->channels, from->height, from->width, error);
  if (status == CLT_OK) {
    memcpy(to->data, from->data, clt_image_size(from) * sizeof *from->data);
  }
  return status;
}

clt_status daemon_picture_copy(const daemon_picture *from, daemon_picture *to, clt_error *error) {
  *to = *from;
  to->drive = to->target = to->lit = (clt_image){0};
  clt_status status = daemon_image_copy(&from->drive, &to->drive, error);
  status = status == CLT_OK ? daemon_image_copy(&from->target, &to->target, error) : status;
  status = status == CLT_OK ? daemon_image_copy(&from->lit, &to->lit, error) : status;
  if (status != CLT_OK) {
    daemon_picture_finish(to);
  }
  return status;
}

void daemon_picture_finish(daemon_picture *picture) {
  clt_image_finish(&picture->drive);
  clt_image_finish(&picture->target);
  clt_image_finish(&picture->lit);
}

void output_drive_free(void *letter) {
  output_drive *gone = letter;
  if (gone != NULL) {
    clt_image_finish(&gone->drive);
    free(gone);
  }
}

void output_pattern_free(void *letter) {
  output_pattern *gone = letter;
  if (gone != NULL) {
    free(gone->codes);
    free(gone);
  }
}

void moving_job_free(void *letter) {
  moving_job *gone = letter;
  if (gone != NULL) {
    model_drop(gone->model);
    free(gone);
  }
}

void measure_job_free(void *letter) {
  measure_job *gone = letter;
  if (gone != NULL) {
    daemon_picture_finish(&gone->picture);
    model_drop(gone->model);
    free(gone);
  }
}

void measure_result_free(void *letter) {
  measure_result *gone = letter;
  if (gone != NULL) {
    clt_transport_destroy(gone->transport);
    clt_image_finish(&gone->observation);
    clt_image_finish(&gone->drive);
    free(gone);
  }
}

void solver_job_free(void *letter) {
  solver_job *gone = letter;
  if (gone != NULL) {
    if (gone->kind == SOLVER_CONTENT && gone->descriptor >= 0) {
      close(gone->descriptor);
    }
    clt_transport_destroy(gone->transport);
    daemon_picture_finish(&gone->picture);
    clt_image_finish(&gone->observation);
    free(gone);
  }
}

void solver_result_free(void *letter) {
  solver_result *gone = letter;
  if (gone != NULL) {
    json_decref(gone->tradeoff);
    model_drop(gone->model);
    daemon_picture_finish(&gone->picture);
    free(gone);
  }
}
