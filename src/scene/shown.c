/* How much of the scene's box the pictures show. */
#include "src/scene/capture.h"
#include <math.h>
#include <stdlib.h>

enum { SIDE = 24, SAMPLES = SIDE * SIDE, THIRDS = 40 };
static const double PART = 0.97; /* of what a picture shows: a few pixels at an edge are nothing that is cut off */

/* Half edge of the smallest cube about the origin that the ray meets: the least of max |o + t d| for t >= 0, which is
 * convex in t. Beyond 3 |o| the ray is farther away than where it begins. */
static double least_cube(const float o[3], const float d[3])
{
  double t0 = 0, t1 = 0;
  for (int i = 0; i < 3; i++) t1 += 3 * fabs((double)o[i]);
  for (int n = 0; n < THIRDS; n++) {
    double at[2] = {0};
    const double third = (t1 - t0) / 3;
    for (int s = 0; s < 2; s++)
      for (int i = 0; i < 3; i++) at[s] = fmax(at[s], fabs((double)o[i] + (t0 + (s + 1) * third) * (double)d[i]));
    if (at[0] < at[1])
      t1 -= third;
    else
      t0 += third;
  }
  double least = 0;
  for (int i = 0; i < 3; i++) least = fmax(least, fabs((double)o[i] + t0 * (double)d[i]));
  return least;
}

static bool has_alpha(const sf_image *image)
{
  const size_t n = (size_t)image->width * (size_t)image->height;
  for (size_t i = 0; i < n; i++)
    if (image->rgba[4 * i + 3] < 65535) return true;
  return false;
}

/* Black or white in a picture without alpha: it may be nothing but the background. */
static bool may_be_background(const uint16_t *p)
{
  const int low = 65535 * 3 / 100, high = 65535 - low;
  return (p[0] < low && p[1] < low && p[2] < low) || (p[0] > high && p[1] > high && p[2] > high);
}

float sf_shown(const sf_view *view)
{
  double cube[SAMPLES];
  int n = 0;
  const sf_image *image = &view->image;
  const bool alpha = has_alpha(image);
  for (int s = 0; s < SAMPLES; s++) {
    const int x = (2 * (s % SIDE) + 1) * image->width / (2 * SIDE),
              y = (2 * (s / SIDE) + 1) * image->height / (2 * SIDE);
    const uint16_t *p = image->rgba + 4 * ((size_t)y * (size_t)image->width + (size_t)x);
    if (alpha ? p[3] < 32768 : may_be_background(p)) continue;
    float origin[3], direction[3];
    sf_camera_ray(&view->camera, (float)x + 0.5f, (float)y + 0.5f, origin, direction);
    cube[n++] = least_cube(origin, direction);
  }
  if (!n) return 0;
  qsort(cube, (size_t)n, sizeof *cube, sf_ascending);
  return (float)cube[(int)(PART * (n - 1))];
}
