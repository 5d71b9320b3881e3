#include "quant/quant.h"

sf_status sf_fx_dataset_load(sf_dataset *data, const fx_scene *scene, const char *name, const char *dir,
                             const char *split, const sf_dataset_options *options)
{
  const float scale = (float)scene->units.model_scale;
  sf_dataset_options how = *options;
  *data = (sf_dataset){0};
  if (scale > 0 && how.scale != 0 && how.scale != scale)
    return sf_fail(SF_E_RANGE, "%s: trained at scale %g, %s is to be read at %g; give --scale %.9g or none", name,
                   (double)scale, dir, (double)how.scale, (double)scale);
  if (scale > 0) how.scale = scale;
  return sf_dataset_load(data, dir, split, &how);
}
