/* Activity of a Verilated run: how long each bit was 0, 1 or X and how often it toggled, from the run's waveform (FST),
 * which is read in pieces so that no large file is needed. Times are the simulation's: two units per clock cycle. */
#ifndef SF_SIM_ACTIVITY_WAVE_H
#define SF_SIM_ACTIVITY_WAVE_H
#include "base/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct sf_wave_instance {
  char *name;
  int parent, level; /* parent -1 and level 1: the top */
  bool used;         /* it or one below it has nets */
} sf_wave_instance;

/* "acc_q[3]" of bits 15:0. Nets that are one wire by several names share a signal. */
typedef struct sf_wave_net {
  char *name;
  int instance, msb, lsb;
  bool vector;
  uint32_t signal; /* 1.. */
} sf_wave_net;

typedef struct sf_wave_signal {
  uint32_t width; /* 0: not a net of the design */
  size_t first;   /* of its bits, the highest first */
} sf_wave_signal;

typedef struct sf_wave_bit {
  uint64_t time[3]; /* units at 0, 1, X */
  uint64_t toggles; /* between 0 and 1 */
  uint64_t since;
} sf_wave_bit;

typedef struct sf_wave {
  uint64_t begin, end; /* counted: begin <= time < end */
  sf_wave_instance *instance;
  sf_wave_net *net;
  sf_wave_signal *signal;
  sf_wave_bit *bit;
  char *value; /* per bit: '0', '1', other */
  size_t bits;
  int instances, nets;
  uint32_t signals; /* signal[1..signals] */
  /* Called for the first value of every signal and for every change of one. value: `width` characters. May be NULL. */
  void (*change)(void *user, uint64_t time, uint32_t signal, const char *value);
  void *user;
} sf_wave;

/* The hierarchy of the first file; nothing is counted before `begin`. */
sf_status sf_wave_open(sf_wave *wave, const char *path, uint64_t begin);
/* Adds the changes of a file of the same model that begins where the last one ended, up to `end`. */
sf_status sf_wave_add(sf_wave *wave, const char *path, uint64_t end);
void sf_wave_free(sf_wave *wave);
/* The bit of a net's position `at`, 0 = the highest; its index in the source. */
const sf_wave_bit *sf_wave_net_bit(const sf_wave *wave, const sf_wave_net *net, uint32_t at);
int sf_wave_net_index(const sf_wave_net *net, uint32_t at);
#endif
