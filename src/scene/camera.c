#include "spikefield/scene.h"
#include <math.h>

void sf_camera_ray(const sf_camera *camera, float px, float py, float origin[3], float direction[3])
{
  const float *m = camera->to_world;
  float x = (px - camera->cx) / camera->fx, y = -(py - camera->cy) / camera->fy;
  float d[3], length = 0;
  for (int i = 0; i < 3; i++) {
    d[i] = m[4 * i] * x + m[4 * i + 1] * y - m[4 * i + 2];
    length += d[i] * d[i];
  }
  length = sqrtf(length);
  for (int i = 0; i < 3; i++) direction[i] = d[i] / length, origin[i] = m[4 * i + 3];
}
