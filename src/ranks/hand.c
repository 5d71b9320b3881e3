/* A rank's worker: a thread, so that the main thread can listen to the others. */
#include "ranks/internal.h"
#include <omp.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

static const size_t STACK = (size_t)16 << 20; /* where stacks are unlimited, those of threads are small */

typedef enum { IDLE, GIVEN, DONE, LEAVE } state;

struct sf_hand {
  const sf_deal *deal;
  pthread_t thread;
  pthread_mutex_t lock;
  pthread_cond_t changed;
  state state;
  int threads; /* of the main thread, which chose them */
  uint64_t unit;
  void *result;
};

static void *work(void *hand)
{
  sf_hand *h = hand;
  omp_set_num_threads(h->threads);
  pthread_mutex_lock(&h->lock);
  for (;;) {
    while (h->state == IDLE || h->state == DONE) pthread_cond_wait(&h->changed, &h->lock);
    if (h->state == LEAVE) break;
    pthread_mutex_unlock(&h->lock);
    memset(h->result, 0, h->deal->result_size);
    h->deal->work(h->deal->user, h->unit, h->result);
    pthread_mutex_lock(&h->lock);
    if (h->state == GIVEN) h->state = DONE;
  }
  pthread_mutex_unlock(&h->lock);
  return NULL;
}

static bool start(sf_hand *h)
{
  pthread_attr_t how;
  if (pthread_attr_init(&how)) return false;
  const bool started = !pthread_attr_setstacksize(&how, STACK) && !pthread_create(&h->thread, &how, work, h);
  pthread_attr_destroy(&how);
  return started;
}

sf_status sf_hand_open(sf_hand **hand, const sf_deal *deal)
{
  sf_hand *h = *hand = calloc(1, sizeof *h);
  if (!h) return sf_fail(SF_E_MEMORY, "out of memory");
  h->deal = deal;
  h->threads = omp_get_max_threads();
  h->result = malloc(deal->result_size);
  pthread_mutex_init(&h->lock, NULL), pthread_cond_init(&h->changed, NULL);
  if (h->result && start(h)) return sf_ok();
  free(h->result), free(h);
  *hand = NULL;
  return sf_fail(SF_E_MEMORY, "no thread to work in");
}

static void change(sf_hand *h, state to)
{
  pthread_mutex_lock(&h->lock);
  h->state = to;
  pthread_cond_signal(&h->changed);
  pthread_mutex_unlock(&h->lock);
}

static state now(sf_hand *h)
{
  pthread_mutex_lock(&h->lock);
  const state s = h->state;
  pthread_mutex_unlock(&h->lock);
  return s;
}

void sf_hand_give(sf_hand *h, uint64_t unit)
{
  h->unit = unit;
  change(h, GIVEN);
}

bool sf_hand_done(sf_hand *h)
{
  return now(h) == DONE;
}

const void *sf_hand_take(sf_hand *h)
{
  change(h, IDLE);
  return h->result;
}

void sf_hand_close(sf_hand *h)
{
  if (!h) return;
  change(h, LEAVE);
  pthread_join(h->thread, NULL);
  pthread_cond_destroy(&h->changed), pthread_mutex_destroy(&h->lock);
  free(h->result), free(h);
}
