/* Four small views for the fuzzing targets of data sets, and what is asked of every view that a reader accepts. */
#ifndef SF_TESTS_FUZZ_DATA_SET_H
#define SF_TESTS_FUZZ_DATA_SET_H
#include "tests/layout_fixture.h"
#include "snn/model.h"
#include "scene/scene.h"
#include "fuzz.h"
#include <math.h>

/* p00.png .. p03.png of 8 x 6 pixels, side by side, looking along -z at four points. */
static inline layout_rig layout_small_rig(void)
{
  layout_rig rig = {.lenses = 2,
                    .views = 4,
                    .points = 4,
                    .lens = {{1, 2, "SIMPLE_RADIAL", 8, 6, 4, {9, 4, 3, 0.01}},
                             {2, 4, "OPENCV", 8, 6, 8, {9, 9, 4, 3, 0.01, 0, 0, 0}}}};
  for (int v = 0; v < 4; v++) {
    layout_view *view = &rig.view[v];
    snprintf(view->name, sizeof view->name, "p%02d.png", v);
    view->lens = 1 + v % 2;
    view->to_world[0] = view->to_world[5] = view->to_world[10] = 1;
    view->to_world[3] = 0.5 * v - 0.7, view->to_world[7] = 0.1 * v * v, view->to_world[11] = 0.05 * v;
    rig.point[v][0] = 0.4 * v, rig.point[v][1] = 0.3 - 0.2 * v, rig.point[v][2] = -3 - v;
  }
  return rig;
}

/* Rays through the corners: finite, and the marcher takes them. */
static inline void fuzz_use_views(const sf_dataset *data)
{
  const sf_config config = sf_config_default();
  sf_steps steps;
  FUZZ_EXPECT(sf_steps_make(&steps, &config, 1).code == SF_OK);
  for (int i = 0; i < data->count; i++) {
    const sf_camera *camera = &data->view[i].camera;
    for (int corner = 0; corner < 4; corner++) {
      float origin[3], direction[3];
      sf_dataset_ray(data, &data->view[i], corner & 1 ? 0.5f : (float)camera->width - 0.5f,
                     corner & 2 ? 0.5f : (float)camera->height - 0.5f, origin, direction);
      for (int a = 0; a < 3; a++) FUZZ_EXPECT(isfinite(origin[a]) && isfinite(direction[a]));
      const sf_lattice lattice = sf_ray_lattice(&steps, origin, direction);
      FUZZ_EXPECT(lattice.count >= 0 && lattice.count <= config.lattice);
    }
  }
}
#endif
