/* Rays of cameras and of views. */
#include "src/scene/lens.h"
#include <math.h>

void sf_camera_ray(const sf_camera *camera, float px, float py, float origin[3], float direction[3])
{
  const float *m = camera->to_world;
  float x = (px - camera->cx) / camera->fx, y = -(py - camera->cy) / camera->fy;
  if (sf_lens_bends(camera)) {
    double straight[2];
    sf_lens_straighten(camera, (double[2]){(double)x, -(double)y}, straight);
    x = (float)straight[0], y = -(float)straight[1];
  }
  float d[3], length = 0;
  for (int i = 0; i < 3; i++) {
    d[i] = m[4 * i] * x + m[4 * i + 1] * y - m[4 * i + 2];
    length += d[i] * d[i];
  }
  length = sqrtf(length);
  for (int i = 0; i < 3; i++) direction[i] = d[i] / length, origin[i] = m[4 * i + 3];
}

bool sf_camera_project(const sf_camera *camera, const float point[3], float pixel[2])
{
  const float *m = camera->to_world;
  double p[3] = {0}, bent[2];
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++) p[k] += (double)m[4 * i + k] * ((double)point[i] - (double)m[4 * i + 3]);
  if (!(p[2] < 0)) return false;
  sf_lens_bend(camera, (double[2]){p[0] / -p[2], p[1] / p[2]}, bent);
  pixel[0] = (float)(bent[0] * camera->fx + camera->cx), pixel[1] = (float)(bent[1] * camera->fy + camera->cy);
  return true;
}

/* Mildenhall et al. 2020, appendix C: straight lines stay straight, the near plane goes to z = -1, infinity to z = 1. A
 * ray that does not look ahead has no such image: it is taken to leave sideways. Origins lie SF_NEAR before the near
 * plane: from there on rays are looked at. */
static void to_ndc(const sf_dataset *data, float origin[3], float direction[3])
{
  const float ahead = fminf(direction[2], -1e-6f), t = -(data->ndc_near + origin[2]) / ahead;
  float d[3] = {0, 0, 2}, length = 0;
  for (int i = 0; i < 2; i++) {
    const float at = (origin[i] + t * direction[i]) / data->ndc_near; /* over the distance of the near plane */
    origin[i] = data->ndc_focal[i] * at * data->scale;
    d[i] = data->ndc_focal[i] * (-direction[i] / ahead - at);
  }
  origin[2] = -data->scale;
  for (int i = 0; i < 3; i++) length += d[i] * d[i];
  length = sqrtf(length);
  for (int i = 0; i < 3; i++) direction[i] = d[i] / length, origin[i] -= (float)SF_NEAR * direction[i];
}

void sf_dataset_ray(const sf_dataset *data, const sf_view *view, float px, float py, float origin[3],
                    float direction[3])
{
  sf_camera_ray(&view->camera, px, py, origin, direction);
  if (data->ndc) to_ndc(data, origin, direction);
}

double sf_dataset_distance(const sf_dataset *data)
{
  double sum = 0;
  for (int v = 0; v < data->count; v++) {
    const float *m = data->view[v].camera.to_world;
    sum += sqrt((double)m[3] * (double)m[3] + (double)m[7] * (double)m[7] + (double)m[11] * (double)m[11]);
  }
  return data->count ? sum / data->count : 0;
}

int sf_dataset_pixels(const sf_dataset *data, int bound)
{
  double focal = 0, side = 0;
  for (int v = 0; v < data->count; v++) {
    const sf_camera *c = &data->view[v].camera;
    focal += sqrt((double)c->fx * (double)c->fy);
    side += (double)(c->width > c->height ? c->width : c->height) / data->count;
  }
  const double distance = data->count * sf_dataset_distance(data);
  const double points = data->ndc ? bound * side / (double)data->scale : 2 * bound * focal / fmax(distance, 1e-9);
  return (int)ceil(fmin(fmax(points, 1), 1 << 20));
}
