/* OpenCV's lens: radial k1, k2 and tangential p1, p2, on coordinates over the focal length, y down. */
#ifndef SF_SCENE_LENS_H
#define SF_SCENE_LENS_H
#include "scene/scene.h"

bool sf_lens_bends(const sf_camera *camera);
/* Where the pinhole's point `straight` comes to lie. */
void sf_lens_bend(const sf_camera *camera, const double straight[2], double bent[2]);
/* The inverse by Newton's method. Converges wherever sf_lens_check found nothing. */
void sf_lens_straighten(const sf_camera *camera, const double bent[2], double straight[2]);
/* SF_E_RANGE where the lens folds the picture over itself: then a pixel has no ray, or several. */
sf_status sf_lens_check(const sf_camera *camera, const char *where);
#endif
