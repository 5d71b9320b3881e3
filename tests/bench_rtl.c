/* The Verilated accelerator: simulation speed, cycles per sample at a firing rate, utilisation. */
#include "bench.h"
#include "bench_rig.h"
#include "base/clock.h"
#include "sim/dut.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Of the nets on 128 lanes, each product dense, one row a cycle: 32 + 16 + 31 + 128 + 3. */
static const double DENSE_CYCLES = 210;

typedef struct figures {
  double samples_per_second, cycles_per_second, cycles_per_sample, utilisation;
} figures;

/* One process, without stalls, as long as `seconds`. */
static sf_status measure(double rate, double seconds, figures *f)
{
  enum { N = FX_BLOCK };
  static rig r;
  static int16_t feature[N][SF_FEATURE_MAX];
  static sf_dut_result result[N];
  sf_dut_sample sample[N];
  SF_TRY(rig_open(&r, NULL, rate));
  for (int i = 0; i < N; i++) {
    const uint32_t pos[3] = {r.block->pos[0][i], r.block->pos[1][i], r.block->pos[2][i]};
    fx_grid_features(&r.scene.grid, pos, feature[i], NULL);
    sample[i] = (sf_dut_sample){.ray = &r.ray[i / RIG_RAY], .first = i % RIG_RAY == 0, .f = feature[i]};
  }
  sf_dut *dut;
  sf_status status = sf_dut_open(&dut, &r.scene, &(sf_dut_options){.seed = 1});
  uint64_t samples = 0;
  const double start = sf_seconds();
  double now = start;
  for (; !status.code && now - start < seconds; now = sf_seconds(), samples += N)
    status = sf_dut_run(dut, sample, N, result);
  if (!status.code) {
    fx_counts counts;
    uint64_t cycles, most = 0;
    status = sf_dut_counts(dut, &counts, &cycles, NULL, NULL);
    for (int l = 0; l < SF_LAYERS; l++)
      if (sf_dut_layer_busy(dut)[l] > most) most = sf_dut_layer_busy(dut)[l];
    *f = (figures){(double)samples / (now - start), (double)cycles / (now - start), (double)cycles / (double)samples,
                   (double)most / (double)cycles};
  }
  sf_dut_close(dut);
  rig_close(&r);
  return status;
}

/* Cycles per sample of TensoRF's decoder, from the accelerator's own counter. */
static sf_status measure_decoder(int inputs, int steps, double rate, double *cycles_per_sample)
{
  enum { N = 4 * FX_BLOCK };
  static rig r;
  static sf_dut_result result[N];
  sf_dut_sample sample[N];
  fx_counts counts;
  uint64_t cycles;
  SF_TRY(rig_open_decoder(&r, inputs, steps, rate));
  for (int i = 0; i < N; i++) sample[i] = (sf_dut_sample){.f = r.block->constant[i % FX_BLOCK]};
  sf_dut *dut;
  sf_status status = sf_dut_open(&dut, &r.scene, &(sf_dut_options){.seed = 1});
  if (!status.code) status = sf_dut_run(dut, sample, N, result);
  if (!status.code) status = sf_dut_counts(dut, &counts, &cycles, NULL, NULL);
  if (!status.code) *cycles_per_sample = (double)cycles / N;
  sf_dut_close(dut);
  rig_close(&r);
  return status;
}

/* naive: every product dense, SF_LANES of them a cycle. */
static sf_status bench_decoders(cJSON *json)
{
  static const int inputs[] = {150, 30}, percent[] = {10, 30};
  for (int i = 0; i < 8; i++) {
    const int n = inputs[i / 4], steps = 2 + i / 2 % 2, rate = percent[i % 2];
    char name[64];
    double cycles;
    SF_TRY(measure_decoder(n, steps, rate / 100.0, &cycles));
    snprintf(name, sizeof name, "rtl.decoder%d.cycles_per_sample.t%d.f%d", n, steps, rate);
    put(json, name, cycles, "cycles", NAN, n + SF_LANES + 3);
  }
  return sf_ok();
}

sf_status bench_rtl(cJSON *json)
{
  figures low, high;
  SF_TRY(measure(0.1, 2, &low));
  SF_TRY(measure(0.3, 2, &high));
  put(json, "rtl.nets.t3", low.samples_per_second, "samples/s", NAN, NAN);
  put(json, "rtl.cycles_per_second", low.cycles_per_second, "cycles/s", NAN, NAN);
  put(json, "rtl.cycles_per_sample.t3", low.cycles_per_sample, "cycles", NAN, DENSE_CYCLES);
  put(json, "rtl.cycles_per_sample.t3.f30", high.cycles_per_sample, "cycles", NAN, DENSE_CYCLES);
  put(json, "rtl.utilisation", high.utilisation, "of the busiest layer's cycles", NAN, NAN);
  return bench_decoders(json);
}
