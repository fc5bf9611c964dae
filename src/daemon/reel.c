#include "daemon/reel.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "base/clock.h"
#include "base/memory.h"

/* Those that wait, the one that is filled and the one that was shown before. */
enum { SPARES = REEL_AHEAD + 2 };

struct reel {
  pthread_mutex_t lock; /* of what follows */
  reel_picture *waiting[REEL_AHEAD];
  int first, count;
  reel_picture *spare[SPARES];
  int spares;
  reel_counts counts;
};

clt_status reel_create(reel **out, clt_error *error) {
  reel *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "moving pictures: out of memory");
  }
  *self = (reel){.first = 0};
  pthread_mutex_init(&self->lock, NULL);
  *out = self;
  return CLT_OK;
}

void reel_picture_free(reel_picture *picture) {
  if (picture != NULL) {
    player_codes_drop(picture->content);
    free(picture->fields);
    free(picture);
  }
}

static reel_picture *head(const reel *self) {
  return self->waiting[self->first];
}

static reel_picture *pop(reel *self) {
  reel_picture *popped = head(self);
  self->first = (self->first + 1) % REEL_AHEAD;
  self->count--;
  return popped;
}

/* Keeps the picture, without its content, to be filled again. */
static void keep(reel *self, reel_picture *picture) {
  if (picture == NULL) {
    return;
  }
  player_codes_drop(picture->content);
  picture->content = NULL;
  if (self->spares < SPARES) {
    self->spare[self->spares++] = picture;
  } else {
    reel_picture_free(picture);
  }
}

void reel_destroy(reel *self) {
  if (self == NULL) {
    return;
  }
  reel_clear(self);
  while (self->spares > 0) {
    reel_picture_free(self->spare[--self->spares]);
  }
  pthread_mutex_destroy(&self->lock);
  free(self);
}

static bool reserve(reel_picture *picture, size_t bytes) {
  if (picture->fields_room < bytes) {
    free(picture->fields);
    picture->fields = clt_alloc(bytes, 1);
    picture->fields_room = picture->fields != NULL ? bytes : 0;
  }
  return picture->fields != NULL;
}

reel_picture *reel_blank(reel *self, size_t bytes) {
  pthread_mutex_lock(&self->lock);
  reel_picture *blank = self->spares > 0 ? self->spare[--self->spares] : clt_alloc(1, sizeof *blank);
  pthread_mutex_unlock(&self->lock);
  if (blank == NULL || !reserve(blank, bytes)) {
    reel_picture_free(blank);
    return NULL;
  }
  return blank;
}

double reel_wait(reel *self, double refresh_s) {
  pthread_mutex_lock(&self->lock);
  double wait_s = self->count == REEL_AHEAD ? refresh_s + 1e-9 * (double)(head(self)->due_ns - clt_clock_ns()) : 0;
  pthread_mutex_unlock(&self->lock);
  return wait_s > 0 ? wait_s : 0;
}

/* Counts a picture that is not shown, unless the one after it has the same content. */
static void pass_over(reel *self, reel_picture *gone, const reel_picture *next) {
  self->counts.skipped += gone->content != next->content;
  keep(self, gone);
}

void reel_put(reel *self, reel_picture *picture) {
  pthread_mutex_lock(&self->lock);
  if (self->count == REEL_AHEAD) {
    reel_picture *oldest = pop(self);
    pass_over(self, oldest, head(self));
  }
  self->waiting[(self->first + self->count++) % REEL_AHEAD] = picture;
  pthread_mutex_unlock(&self->lock);
}

void reel_clear(reel *self) {
  pthread_mutex_lock(&self->lock);
  while (self->count > 0) {
    keep(self, pop(self));
  }
  pthread_mutex_unlock(&self->lock);
}

bool reel_take(reel *self, int64_t at_ns, double refresh_s, reel_picture **shown) {
  const int64_t refresh_ns = llround(1e9 * refresh_s);
  reel_picture *taken = NULL;
  pthread_mutex_lock(&self->lock);
  if (self->count > 0 && head(self)->due_ns <= at_ns + refresh_ns / 2) {
    taken = pop(self);
  }
  while (taken != NULL && self->count > 0 && head(self)->due_ns <= at_ns) {
    pass_over(self, taken, head(self));
    taken = pop(self);
  }
  if (taken != NULL) {
    bool fresh = *shown == NULL || (*shown)->content != taken->content;
    self->counts.shown += fresh;
    self->counts.late += fresh && taken->due_ns != 0 && at_ns - taken->due_ns > refresh_ns;
    keep(self, *shown);
    *shown = taken;
  }
  pthread_mutex_unlock(&self->lock);
  return taken != NULL;
}

reel_counts reel_count(reel *self) {
  pthread_mutex_lock(&self->lock);
  const reel_counts counts = self->counts;
  self->counts = (reel_counts){0};
  pthread_mutex_unlock(&self->lock);
  return counts;
}
