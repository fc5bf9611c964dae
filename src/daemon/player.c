#include "daemon/player.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

#include "base/clock.h"
#include "base/memory.h"

enum { SLOTS = 4 };

/* After a failure the film is tried again, s. */
static const time_t retry_s = 1;

typedef struct slot {
  uint8_t *codes;
  clt_film_frame shape;
  int64_t due_ns;
} slot;

struct player {
  clt_film *film;
  pthread_t thread;
  bool started;
  pthread_mutex_t lock; /* of what follows */
  pthread_cond_t changed;
  slot slots[SLOTS]; /* count of them are decoded, from first on */
  int first, count;
  uint8_t *out; /* handed out last */
  bool stopping;
  int64_t next_ns;   /* when the next frame is due; 0: at once */
  clt_error problem; /* of the last try */
};

/* Puts a decoded frame behind the others. One that comes later than the next refreshes could show moves the film. */
static void append(player *self, const clt_film_frame *shape) {
  slot *made = &self->slots[(self->first + self->count) % SLOTS];
  int64_t now_ns = clt_clock_ns();
  made->shape = *shape;
  made->due_ns = self->next_ns > now_ns ? self->next_ns : now_ns;
  self->next_ns = made->due_ns + (isfinite(shape->seconds) ? llround(1e9 * shape->seconds) : 0);
  self->count++;
}

static void wait_for_retry(player *self) {
  struct timespec until;
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_sec += retry_s;
  pthread_cond_timedwait(&self->changed, &self->lock, &until);
}

/* Decodes into the free slot behind the decoded ones; true while there is more to come. */
static bool decode_one(player *self) {
  uint8_t *codes = self->slots[(self->first + self->count) % SLOTS].codes;
  clt_film_frame shape = {0};
  clt_error problem = {0};
  pthread_mutex_unlock(&self->lock);
  clt_status status = clt_film_next(self->film, codes, &shape, &problem);
  pthread_mutex_lock(&self->lock);
  self->problem = problem;
  self->problem.status = status;
  if (status == CLT_OK) {
    append(self, &shape);
  } else if (!self->stopping) {
    wait_for_retry(self);
  }
  return status != CLT_OK || isfinite(shape.seconds);
}

static void *decode(void *data) {
  player *self = data;
  bool more = true;
  pthread_mutex_lock(&self->lock);
  while (more && !self->stopping) {
    if (self->count < SLOTS) {
      more = decode_one(self);
    } else {
      pthread_cond_wait(&self->changed, &self->lock);
    }
  }
  pthread_mutex_unlock(&self->lock);
  return NULL;
}

static clt_status start(player *self, clt_error *error) {
  size_t bytes = clt_film_bytes(self->film);
  self->out = clt_alloc(bytes, 1);
  bool ready = self->out != NULL;
  for (int i = 0; i < SLOTS; i++) {
    self->slots[i].codes = clt_alloc(bytes, 1);
    ready = ready && self->slots[i].codes != NULL;
  }
  self->started = ready && pthread_create(&self->thread, NULL, decode, self) == 0;
  return self->started ? CLT_OK : clt_fail(error, CLT_FAILED, "a film cannot be played: out of memory or threads");
}

clt_status player_create(const char *path, const clt_film_options *options, player **out, clt_error *error) {
  player *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "a film cannot be played: out of memory");
  }
  pthread_mutex_init(&self->lock, NULL);
  pthread_cond_init(&self->changed, NULL);
  clt_status status = clt_film_open(path, options, &self->film, error);
  status = status == CLT_OK ? start(self, error) : status;
  if (status != CLT_OK) {
    player_destroy(self);
    return status;
  }
  *out = self;
  return CLT_OK;
}

void player_destroy(player *self) {
  if (self == NULL) {
    return;
  }
  if (self->started) {
    pthread_mutex_lock(&self->lock);
    self->stopping = true;
    pthread_cond_broadcast(&self->changed);
    pthread_mutex_unlock(&self->lock);
    pthread_join(self->thread, NULL);
  }
  for (int i = 0; i < SLOTS; i++) {
    free(self->slots[i].codes);
  }
  free(self->out);
  clt_film_close(self->film);
  pthread_cond_destroy(&self->changed);
  pthread_mutex_destroy(&self->lock);
  free(self);
}

bool player_take(player *self, int64_t until_ns, player_frame *frame, int *skipped) {
  int taken = 0;
  pthread_mutex_lock(&self->lock);
  while (self->count > 0 && self->slots[self->first].due_ns <= until_ns) {
    slot *due = &self->slots[self->first];
    uint8_t *older = self->out;
    self->out = due->codes;
    due->codes = older;
    *frame = (player_frame){.codes = self->out, .shape = due->shape, .due_ns = due->due_ns};
    self->first = (self->first + 1) % SLOTS;
    self->count--;
    taken++;
  }
  pthread_cond_broadcast(&self->changed);
  pthread_mutex_unlock(&self->lock);
  *skipped = taken > 0 ? taken - 1 : 0;
  return taken > 0;
}

double player_due(player *self) {
  pthread_mutex_lock(&self->lock);
  double left = self->count > 0 ? 1e-9 * (double)(self->slots[self->first].due_ns - clt_clock_ns()) : INFINITY;
  pthread_mutex_unlock(&self->lock);
  return left > 0 ? left : 0;
}

bool player_failed(player *self, clt_error *error) {
  pthread_mutex_lock(&self->lock);
  *error = self->problem;
  pthread_mutex_unlock(&self->lock);
  return error->status != CLT_OK;
}
