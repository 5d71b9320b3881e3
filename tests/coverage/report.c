/* Table of the functional coverage, with the holes named: report [MINIMUM_PERCENT] */
#include "sim/cover.h"
#include "energy/energy.h"
#include <stdio.h>
#include <stdlib.h>

static const char *const mode_name[] = {"hybrid", "decay", "no-decay", "radix"};
static const char *const phase_name[SF_PHASES] = {"idle",           "packet half in",     "sample in", "after D1",
                                                  "after D2",       "after C1",           "after C2",  "after C3",
                                                  "result waiting", "half a result taken"};
static const char *const error_name[SF_COVER_ERRORS] = {"SIZE", "STEPS",   "LEAK",   "THETA",  "MODE", "SCALE",
                                                        "BUSY", "ADDRESS", "WEIGHT", "PACKET", "VALUE"};

typedef struct group {
  const char *name;
  int bins, hit;
} group;

static void bin(group *g, uint64_t count, const char *name)
{
  g->bins++;
  g->hit += count > 0;
  if (!count) printf("  hole: %s: %s\n", g->name, name);
}

/* Only no-decay adds currents up and only radix doubles a membrane, which needs several steps to a rail in both: D1 and
 * C1 two, C2 three. Two of the smallest formats cannot be filled: colour holds 16 steps of the largest sigmoid. The
 * sums of radix fit. */
static bool possible(int layer, int mode, int step, bool saturated)
{
  if (!saturated) return true;
  if (layer == FX_D2) return mode != FX_RADIX;
  if (layer == FX_C3 || (mode != FX_NODECAY && mode != FX_RADIX)) return false;
  return step >= (layer == FX_C2 ? 2 : 1);
}

static void beats(const sf_cover *cover, group *g)
{
  char name[96];
  for (int l = 0; l < SF_LAYERS; l++)
    for (int m = 0; m < SF_COVER_MODES; m++)
      for (int t = 0; t < SF_T_MAX; t++)
        for (int i = 0; i < 4; i++) {
          const bool saturated = i & 1, stalled = i >> 1;
          if (!possible(l, m, t, saturated)) continue;
          snprintf(name, sizeof name, "%s %s step %d, %s, %s", fx_layer_name(l), mode_name[m], t,
                   saturated ? "saturated" : "in range", stalled ? "stalled" : "not stalled");
          bin(g, cover->beat[l][m][t][saturated][stalled], name);
        }
}

static void samples(const sf_cover *cover, group *steps, group *spikes)
{
  char name[96];
  for (int m = 0; m < SF_COVER_MODES; m++)
    for (int t = 0; t < SF_T_MAX; t++) {
      snprintf(name, sizeof name, "%s, %d steps", mode_name[m], t + 1);
      bin(steps, cover->steps[m][t], name);
    }
  for (int l = 0; l < SF_LAYERS; l++) {
    if (l == FX_D2 || l == FX_C3) continue;
    snprintf(name, sizeof name, "%s silent", fx_layer_name(l));
    bin(spikes, cover->silent[l], name);
    snprintf(name, sizeof name, "%s all firing", fx_layer_name(l));
    bin(spikes, cover->full[l], name);
  }
}

static int finish(const group *g, int n, double minimum)
{
  int bins = 0, hit = 0;
  for (int i = 0; i < n; i++) {
    printf("%-44s %4d of %4d\n", g[i].name, g[i].hit, g[i].bins);
    bins += g[i].bins, hit += g[i].hit;
  }
  const double percent = 100.0 * hit / bins;
  printf("functional coverage: %d of %d bins, %.1f %%\n", hit, bins, percent);
  return percent < minimum;
}

int main(int argc, char **argv)
{
  group g[] = {{"layer x mode x step x saturation x stall", 0, 0},
               {"mode x number of steps", 0, 0},
               {"spike bitmaps", 0, 0},
               {"errors", 0, 0},
               {"soft reset by phase", 0, 0},
               {"clear and snapshot", 0, 0},
               {"decoder x biases", 0, 0}};
  sf_cover *cover = sf_cover_open();
  if (!cover) {
    fputs("report: no functional coverage in this build\n", stderr);
    return 1;
  }
  beats(cover, &g[0]);
  samples(cover, &g[1], &g[2]);
  for (int i = 0; i < SF_COVER_ERRORS; i++) bin(&g[3], cover->error[i], error_name[i]);
  for (int i = 0; i < SF_PHASES; i++) bin(&g[4], cover->reset[i], phase_name[i]);
  for (int i = 0; i < 4; i++)
    bin(&g[5], cover->walk[i / 2][i % 2],
        (const char *[]){"clear, idle", "clear, at work", "snapshot, idle", "snapshot, at work"}[i]);
  for (int i = 0; i < 4; i++)
    bin(&g[6], cover->inputs[i / 2][i % 2],
        (const char *[]){"densities", "densities, biases", "decoder", "decoder, biases"}[i]);
  sf_cover_close(cover);
  return finish(g, (int)(sizeof g / sizeof *g), argc > 1 ? atof(argv[1]) : 0);
}
