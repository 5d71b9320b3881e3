/* One ray through the ray FIFOs of the reference system (sf_soc.h): positions in, a pixel out. A system that moves
 * beats in another way, by DMA for one, replaces this file alone. */
#ifndef SF_FIRMWARE_SF_RAY_STREAM_H
#define SF_FIRMWARE_SF_RAY_STREAM_H
#include "firmware/sf_driver.h"
#include "fx/fx.h"

/* Sends the ray's occupied lattice points until the last one, or until its pixel has come. new_tile: the field's cache
 * is emptied before the ray. SF_DRIVER_TIMEOUT if the accelerator takes or gives nothing: its registers may say why. */
sf_driver_code sf_ray_stream_pixel(const sf_bus *fifos, const fx_scene *scene, const fx_ray *ray, bool new_tile,
                                   fx_pixel *pixel);
#endif
