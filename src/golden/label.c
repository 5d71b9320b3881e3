#include "golden/golden.h"

sf_status sf_golden_save_labelled(const sf_golden *golden, const char *path, const sf_golden_label *label)
{
  char steps[16], crop[64], downscale[16], saturation[256], unexpected[64];
  const sf_window *w = &label->window;
  snprintf(steps, sizeof steps, "%d", label->net->steps);
  snprintf(crop, sizeof crop, "%d,%d,%d,%d", w->x, w->y, w->width, w->height);
  snprintf(downscale, sizeof downscale, "%d", label->downscale);
  sf_saturation_census(golden->counts.saturated_samples, golden->counts.saturated_features, saturation,
                       sizeof saturation);
  sf_saturation_unexpected(label->net, golden->counts.saturated_samples, unexpected, sizeof unexpected);
  bool is_float = golden->planes == SF_FLOAT_PLANES;
  const char *const attributes[] = {"t_r",
                                    steps,
                                    "scene_sha256",
                                    label->scene_sha256,
                                    "view",
                                    label->view,
                                    "split",
                                    label->split,
                                    "crop",
                                    crop,
                                    "downscale",
                                    downscale,
                                    "arithmetic",
                                    is_float ? "float" : "fixed",
                                    "Z_units",
                                    label->ndc ? "NDC units from the rays' origins, 0 = nothing hit"
                                               : "world units of the data set, 0 = nothing hit",
                                    is_float ? NULL : "saturation",
                                    saturation,
                                    "unexpected_saturation",
                                    unexpected,
                                    NULL};
  return sf_golden_save(golden, path, attributes);
}
