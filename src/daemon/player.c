#include "daemon/player.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

#include "base/clock.h"
#include "base/memory.h"
#include "daemon/input.h"
#include "daemon/rank.h"

/* Frames decoded ahead; and all that there may be, with those that are decoded into, worked on, on their way and shown.
 */
enum { SLOTS = 4, POOL = SLOTS + 8 };

/* After a failure the film is tried again, s. */
static const time_t retry_s = 1;

typedef struct slot {
  player_codes *codes; /* held */
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
  player_codes *pool[POOL]; /* held; used again where nobody else holds them */
  bool stopping;
  int64_t next_ns; /* when the next frame is due; 0: at once */
  uint64_t slipped;
  bool live;         /* an input: frames are due as they come; of a file there is time */
  clt_error problem; /* of the last try */
};

static player_codes *make_codes(size_t bytes) {
  player_codes *made = clt_alloc(1, sizeof *made);
  uint8_t *data = clt_alloc(bytes, 1);
  if (made == NULL || data == NULL) {
    free(made);
    free(data);
    return NULL;
  }
  made->data = data;
  atomic_init(&made->holders, 1);
  return made;
}

player_codes *player_codes_hold(player_codes *codes) {
  if (codes != NULL) {
    atomic_fetch_add(&codes->holders, 1);
  }
  return codes;
}

void player_codes_drop(player_codes *codes) {
  if (codes != NULL && atomic_fetch_sub(&codes->holders, 1) == 1) {
    free(codes->data);
    free(codes);
  }
}

/* Codes that nobody else holds, held for the caller; NULL where there is no memory for them. */
static player_codes *free_codes(player *self) {
  for (int i = 0; i < POOL; i++) {
    if (self->pool[i] == NULL) {
      self->pool[i] = make_codes(clt_film_bytes(self->film));
      return player_codes_hold(self->pool[i]);
    }
    if (atomic_load(&self->pool[i]->holders) == 1) {
      return player_codes_hold(self->pool[i]);
    }
  }
  return NULL;
}

/* Of an input whose pictures are not taken the oldest goes. */
static void make_room(player *self) {
  if (self->count == SLOTS) {
    player_codes_drop(self->slots[self->first].codes);
    self->first = (self->first + 1) % SLOTS;
    self->count--;
  }
}

/* Puts a decoded frame behind the others. One that comes later than the next refreshes could show moves the film; those
 * of an input are due as they come. */
static void append(player *self, player_codes *codes, const clt_film_frame *shape) {
  make_room(self);
  slot *made = &self->slots[(self->first + self->count) % SLOTS];
  int64_t now_ns = clt_clock_ns();
  made->codes = codes;
  made->shape = *shape;
  made->due_ns = self->next_ns > now_ns ? self->next_ns : now_ns;
  self->slipped += self->next_ns > 0 && self->next_ns < now_ns;
  self->next_ns = self->live ? 0 : made->due_ns + (isfinite(shape->seconds) ? llround(1e9 * shape->seconds) : 0);
  self->count++;
}

static void wait_for_retry(player *self) {
  struct timespec until;
  clock_gettime(CLOCK_REALTIME, &until);
  until.tv_sec += retry_s;
  pthread_cond_timedwait(&self->changed, &self->lock, &until);
}

/* True while there is more to come. */
static bool decode_one(player *self) {
  clt_film_frame shape = {0};
  clt_error problem = {0};
  pthread_mutex_unlock(&self->lock);
  player_codes *codes = free_codes(self);
  clt_status status = codes != NULL
                          ? clt_film_next(self->film, codes->data, &shape, &problem)
                          : clt_fail(&problem, CLT_FAILED, "no memory for the frames of a film; it stands still");
  pthread_mutex_lock(&self->lock);
  self->problem = problem;
  self->problem.status = status;
  if (status == CLT_OK) {
    append(self, codes, &shape);
    return isfinite(shape.seconds);
  }
  player_codes_drop(codes);
  if (!self->stopping) {
    wait_for_retry(self);
  }
  return true;
}

/* A film is not decoded where it is computed, unless it runs short. */
static void keep_aside(const player *self, rank_place *place) {
  if (!self->live) {
    rank_keep(place, self->count >= SLOTS / 2 ? RANK_ASIDE : RANK_ALL);
  }
}

static void *decode(void *data) {
  player *self = data;
  bool more = true;
  rank_place place = rank_stand();
  if (!self->live) {
    rank_behind(RANK_AHEAD);
    rank_take_turns(RANK_LONG);
  }
  pthread_mutex_lock(&self->lock);
  while (more && !self->stopping) {
    if (self->count < SLOTS || self->live) {
      keep_aside(self, &place);
      more = decode_one(self);
    } else {
      pthread_cond_wait(&self->changed, &self->lock);
    }
  }
  pthread_mutex_unlock(&self->lock);
  return NULL;
}

static clt_status start(player *self, clt_error *error) {
  self->started = pthread_create(&self->thread, NULL, decode, self) == 0;
  return self->started ? CLT_OK : clt_fail(error, CLT_FAILED, "a film cannot be played: out of threads");
}

clt_status player_create(const char *path, const clt_film_options *options, player **out, clt_error *error) {
  player *self = clt_alloc(1, sizeof *self);
  if (self == NULL) {
    return clt_fail(error, CLT_FAILED, "a film cannot be played: out of memory");
  }
  pthread_mutex_init(&self->lock, NULL);
  pthread_cond_init(&self->changed, NULL);
  self->live = input_is(path);
  clt_status status = input_film(path, options, &self->film, error);
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
  for (int i = 0; i < self->count; i++) {
    player_codes_drop(self->slots[(self->first + i) % SLOTS].codes);
  }
  for (int i = 0; i < POOL; i++) {
    player_codes_drop(self->pool[i]);
  }
  clt_film_close(self->film);
  pthread_cond_destroy(&self->changed);
  pthread_mutex_destroy(&self->lock);
  free(self);
}

bool player_take(player *self, int64_t ahead_ns, int64_t until_ns, player_frame *frame, int *skipped) {
  int taken = 0;
  pthread_mutex_lock(&self->lock);
  while (self->count > 0 && self->slots[self->first].due_ns <= (taken > 0 ? until_ns : ahead_ns)) {
    const slot *due = &self->slots[self->first];
    player_codes_drop(frame->codes);
    *frame = (player_frame){.codes = due->codes, .shape = due->shape, .due_ns = due->due_ns};
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

uint64_t player_slipped(player *self) {
  pthread_mutex_lock(&self->lock);
  uint64_t slipped = self->slipped;
  pthread_mutex_unlock(&self->lock);
  return slipped;
}

bool player_failed(player *self, clt_error *error) {
  pthread_mutex_lock(&self->lock);
  *error = self->problem;
  pthread_mutex_unlock(&self->lock);
  return error->status != CLT_OK;
}
