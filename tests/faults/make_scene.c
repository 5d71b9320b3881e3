/* Writes a small random scene for the planted faults: make_scene SCENE.snn [NEURONS]. With fewer neurons a layer than
 * lanes the block is programmed sooner. */
#include "tests/fx_fixture.h"
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv)
{
  const int n = argc == 3 ? atoi(argv[2]) : SF_LANES;
  const fixture_sizes sizes = {16, n, 16, 16, n, n, 3, FX_HYBRID, {0}};
  if (argc < 2 || argc > 3 || n < 1 || n > SF_LANES) return 2;
  fx_scene scene = {0};
  fixture_set_sizes(&scene, &sizes);
  sf_status status = fx_scene_allocate(&scene, argv[1]);
  if (status.code == SF_OK) {
    fixture_fill(&scene, &sizes, 5);
    for (int l = 0; l < SF_LAYERS; l++) scene.net.layer[l].k = 1500 + 300 * l; /* leaks that need rounding */
    /* C1's neurons 63 and 64 fire at every step, whatever the ray: harmonic 0 is a positive constant. */
    fx_layer *c1 = &scene.net.layer[FX_C1];
    for (int i = 0; n > 64 && i < c1->n_in; i++) c1->w[i * SF_LANES + 63] = c1->w[i * SF_LANES + 64] = i ? 0 : 127;
    c1->theta = 15000;
    if (n < SF_LANES) scene.net.layer[FX_C2].theta /= 2; /* fewer inputs */
    scene.step_q24 = 600000;                             /* short rays: many directions */
    memset(scene.occupancy, 0xff, 64);
    status = fx_scene_save(&scene, argv[1]);
  }
  if (status.code != SF_OK) fprintf(stderr, "make_scene: %s\n", status.message);
  fx_scene_free(&scene);
  return status.code != SF_OK;
}
