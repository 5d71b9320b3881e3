/* The golden image: what a view looks like and what it cost, per pixel. One set of planes for the float field, the
 * fixed-point core and the accelerator; the last two must fill them with the same bits. */
#ifndef SF_GOLDEN_GOLDEN_H
#define SF_GOLDEN_GOLDEN_H
#include "energy/energy.h"
#include "image/image.h"
#include "snn/model.h"

/* R G B: composited over the scene's background, 1.0 = white; fixed: fx.* / 65535. A: what the ray hit.
 * Z: mean distance from the camera of what the ray hit, world units of the data set; 0 where it hit nothing. Of
 * a forward-facing data set: from the ray's origin, in units of NDC, which are no lengths of the world.
 * samples: through the nets. spikes, sops, macs: events; energy_fJ: paper ledger, 4600 * macs + 900 * sops.
 * fx.R .. fx.A: fx_pixel_rgba; fx.T: transmittance left, Q.TRANS_FRAC; fx.Zhi, fx.Zlo: the two halves of
 * fx_pixel.depth. */
typedef enum {
  SF_PLANE_R,
  SF_PLANE_G,
  SF_PLANE_B,
  SF_PLANE_A,
  SF_PLANE_Z,
  SF_PLANE_SAMPLES,
  SF_FLOAT_PLANES, /* the float field has no events and no raw integers */
  SF_PLANE_SPIKES = SF_FLOAT_PLANES,
  SF_PLANE_SOPS,
  SF_PLANE_MACS,
  SF_PLANE_ENERGY,
  SF_PLANE_FX_R,
  SF_PLANE_FX_G,
  SF_PLANE_FX_B,
  SF_PLANE_FX_A,
  SF_PLANE_FX_T,
  SF_PLANE_FX_ZHI,
  SF_PLANE_FX_ZLO,
  SF_PLANES
} sf_plane;

extern const char *const sf_plane_names[SF_PLANES]; /* the EXR channels */
bool sf_plane_is_integer(sf_plane plane);           /* uint32_t, else float */

typedef struct sf_golden {
  int width, height, planes; /* planes: SF_FLOAT_PLANES or SF_PLANES */
  void *plane[SF_PLANES];    /* [height][width] float or uint32_t, owned */
  fx_counts counts;          /* of all pixels */
} sf_golden;

sf_status sf_golden_create(sf_golden *golden, int width, int height, int planes);
void sf_golden_free(sf_golden *golden);
static inline float *sf_golden_real(const sf_golden *g, sf_plane plane)
{
  return g->plane[plane];
}
static inline uint32_t *sf_golden_int(const sf_golden *g, sf_plane plane)
{
  return g->plane[plane];
}

/* Pixel i of a fixed-point image. step_length: distance between samples in units of Z. */
void sf_golden_set(sf_golden *golden, size_t i, const fx_pixel *pixel, const fx_cost *cost, double step_length);

/* A window of a view, pixels from its top left corner. */
typedef struct sf_window {
  int x, y, width, height;
} sf_window;

/* One window of one view, to be rendered into a golden image of the window's size. */
typedef struct sf_golden_job {
  const fx_scene *scene; /* net.steps: the time steps that run */
  const sf_dataset *data;
  const sf_view *view; /* of data */
  sf_window window;
  const char *kernels;                     /* of the fixed-point core, as fx_core_open; NULL: the fastest */
  bool (*tick)(void *user, size_t pixels); /* so many more are done; from one thread at a time; false stops. Or NULL */
  void *user;
} sf_golden_job;
double sf_golden_step_length(const sf_golden_job *job); /* between samples, units of Z */
sf_status sf_golden_stopped(const sf_golden_job *job);  /* SF_E_STOPPED, naming the view */
/* Planes and counts, the same for any number of threads. SF_E_STOPPED when tick says so. */
sf_status sf_golden_fixed(const sf_golden_job *job, sf_golden *golden);
/* counts: samples and rays alone. */
sf_status sf_golden_float(const sf_golden_job *job, const sf_model *model, sf_golden *golden);

/* EXR with every plane as a channel; attributes as sf_exr_save. */
sf_status sf_golden_save(const sf_golden *golden, const char *path, const char *const *attributes);
/* Where a picture comes from, kept in its EXR. Nothing here tells `fixed` from `rtl`, nor when or where it ran: equal
 * pictures are equal files. */
typedef struct sf_golden_label {
  const fx_net *net;
  const char *scene_sha256, *view, *split;
  sf_window window;
  int downscale; /* as sf_dataset's */
  bool ndc;      /* of the data set: what Z is */
} sf_golden_label;
sf_status sf_golden_save_labelled(const sf_golden *golden, const char *path, const sf_golden_label *label);
/* R G B, opaque. */
sf_status sf_golden_save_png(const sf_golden *golden, const char *path);

/* The window of a picture that a rendering is compared with, composited: what sf_golden_quality takes, which checks it.
 */
sf_status sf_golden_save_truth(const sf_golden *golden, const sf_image *picture, int x, int y,
                               const float background[3], const char *path);

/* Against the window at (x, y) of a picture composited over background[3]. SSIM is NaN when a side is below 11. */
sf_status sf_golden_quality(const sf_golden *golden, const sf_image *picture, int x, int y, const float background[3],
                            double *psnr, double *ssim);

/* What a rendering reports beside its files. */
typedef struct sf_render_report {
  const char *scene, *sha256, *view, *backend, *exr, *png; /* png may be NULL */
  const fx_net *net;
  sf_window crop;
  bool crop_chosen;           /* by the program, not by the user */
  bool events;                /* counts hold events, not only samples and rays: all but float */
  double psnr, ssim, seconds; /* NaN: not measured */
  const sf_golden *golden;
} sf_render_report;
void sf_render_report_print(FILE *out, const sf_render_report *report);
cJSON *sf_render_report_json(const sf_render_report *report);
#endif
