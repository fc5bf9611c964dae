#include "base/mailbox.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>

#include "base/memory.h"

struct clt_mailbox {
  pthread_mutex_t lock;
  pthread_cond_t arrived;
  void *letter;
  bool closed;
  void (*drop)(void *letter);
};

clt_status clt_mailbox_create(void (*drop)(void *letter), clt_mailbox **out, clt_error *error) {
  clt_mailbox *mailbox = clt_alloc(1, sizeof *mailbox);
  if (mailbox == NULL) {
    return clt_fail(error, CLT_FAILED, "a mailbox: out of memory");
  }
  pthread_condattr_t attributes;
  pthread_condattr_init(&attributes);
  pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
  pthread_mutex_init(&mailbox->lock, NULL);
  pthread_cond_init(&mailbox->arrived, &attributes);
  pthread_condattr_destroy(&attributes);
  mailbox->drop = drop;
  *out = mailbox;
  return CLT_OK;
}

static void drop_letter(clt_mailbox *mailbox, void *letter) {
  if (letter != NULL && mailbox->drop != NULL) {
    mailbox->drop(letter);
  }
}

void clt_mailbox_destroy(clt_mailbox *mailbox) {
  if (mailbox == NULL) {
    return;
  }
  drop_letter(mailbox, mailbox->letter);
  pthread_cond_destroy(&mailbox->arrived);
  pthread_mutex_destroy(&mailbox->lock);
  free(mailbox);
}

void clt_mailbox_put(clt_mailbox *mailbox, void *letter) {
  pthread_mutex_lock(&mailbox->lock);
  void *older = mailbox->letter;
  mailbox->letter = letter;
  pthread_cond_signal(&mailbox->arrived);
  pthread_mutex_unlock(&mailbox->lock);
  drop_letter(mailbox, older);
}

static struct timespec deadline_after(double seconds) {
  struct timespec when;
  clock_gettime(CLOCK_MONOTONIC, &when);
  int64_t ns = when.tv_nsec + (int64_t)(seconds * 1e9);
  when.tv_sec += ns / 1000000000;
  when.tv_nsec = ns % 1000000000;
  return when;
}

void *clt_mailbox_take(clt_mailbox *mailbox, double timeout_s) {
  struct timespec deadline = deadline_after(timeout_s > 0 ? timeout_s : 0);
  pthread_mutex_lock(&mailbox->lock);
  int waited = 0;
  while (mailbox->letter == NULL && !mailbox->closed && timeout_s != 0 && waited == 0) {
    waited = timeout_s < 0 ? pthread_cond_wait(&mailbox->arrived, &mailbox->lock)
                           : pthread_cond_timedwait(&mailbox->arrived, &mailbox->lock, &deadline);
  }
  void *letter = mailbox->letter;
  mailbox->letter = NULL;
  pthread_mutex_unlock(&mailbox->lock);
  return letter;
}

void clt_mailbox_close(clt_mailbox *mailbox) {
  pthread_mutex_lock(&mailbox->lock);
  mailbox->closed = true;
  pthread_cond_broadcast(&mailbox->arrived);
  pthread_mutex_unlock(&mailbox->lock);
}
