/* The manifest of a set of golden images: enough to render it again on any machine and to name what differs.
 *
 * What is hashed (SHA-256, lower-case hex) is never a file's bytes where a picture is meant: libOpenEXR and zlib may
 * pack the same pixels differently. Every number is written least significant byte first.
 *
 * planes.NAME: the integer plane NAME, width * height values of 4 bytes, row by row from the top left pixel. NAME is
 * the EXR channel, which holds the same values as UINT.
 *
 * counts_sha256: the event counts, 8 bytes each. For layer D1 D2 C1 C2 C3, for event mac sop spikes updates weight
 * state_r state_w special, for step 0 .. t_r-1; then samples, rays, grid_bytes, march_steps; then saturated of the five
 * layers; then saturated_samples of the five layers; then saturated_features; of a TensoRF scene then field_samples and
 * field_mac.
 *
 * camera_sha256: width, height as 4-byte integers; fx fy cx cy and to_world[12] as IEEE single precision; then, unless
 * all are zero, k1 k2 p1 p2. Pictures can only be equal where the rays are.
 *
 * exr_sha256: the file beside the manifest, byte by byte. Tells whether it was changed, not what it shows.
 *
 * Nothing depends on threads, on time, or on whether core or accelerator rendered. A float picture may differ between
 * machines in its last bits: it has a file hash alone. */
#ifndef SF_GOLDEN_MANIFEST_H
#define SF_GOLDEN_MANIFEST_H
#include "golden/golden.h"

enum { SF_MANIFEST_VERSION = 1 };
#define SF_MANIFEST_FORMAT "spikefield-golden"

/* What the pictures are made from. Two sets of the same origin are equal. */
typedef struct sf_manifest_origin {
  char scene_sha256[65];
  char model_sha256[65]; /* float; else "" */
  char split[64];
  int steps;      /* t_r */
  int downscale;  /* as sf_dataset's */
  float scale;    /* model units per world unit */
  sf_window crop; /* of every view; width 0: whole views */
} sf_manifest_origin;

/* One finished view. Counts are below 2^50. */
typedef struct sf_manifest_view {
  int index; /* in the split, from 0 */
  char name[256];
  int width, height; /* of the picture */
  char camera_sha256[65];
  char plane_sha256[SF_PLANES][65];         /* "" for planes of floats */
  char counts_sha256[65];                   /* float: "" */
  uint64_t samples, rays, event[SF_EVENTS]; /* float: no events */
  char unexpected_saturation[64];           /* as sf_saturation_unexpected */
  char exr[64], exr_sha256[65];             /* in the folder of the manifest */
  double psnr, ssim;                        /* NaN: not measured; kept to 4 digits behind the point */
} sf_manifest_view;

typedef struct sf_manifest {
  sf_manifest_origin origin;
  int total, count;       /* views in the split; finished ones */
  sf_manifest_view *view; /* [count], ascending index, owned */
} sf_manifest;

/* A sum over views, for the manifest's totals and reports. Means are NaN unless every view was measured. */
typedef struct sf_manifest_sum {
  uint64_t samples, rays, event[SF_EVENTS], energy_fj, pixels;
  double psnr, ssim;
} sf_manifest_sum;
void sf_manifest_sums(const sf_manifest *manifest, sf_manifest_sum *sum);
uint64_t sf_manifest_energy_fj(const sf_manifest_view *view);

/* SF_E_FORMAT or SF_E_RANGE names file and field, also where totals, means and the flag "complete" contradict the
 * views. Fields of another version are refused, so are those missing; unknown ones too. */
sf_status sf_manifest_load(sf_manifest *manifest, const char *path);
sf_status sf_manifest_save(const sf_manifest *manifest, const char *path);
void sf_manifest_free(sf_manifest *manifest);

/* Inserts the view, or replaces the one with its index. */
sf_status sf_manifest_put(sf_manifest *manifest, const sf_manifest_view *view);
const sf_manifest_view *sf_manifest_find(const sf_manifest *manifest, int index); /* or NULL */

/* SF_E_DIFFERENCE names the first field that differs and both values; here: what is being rendered now. */
sf_status sf_manifest_same_origin(const sf_manifest_origin *wanted, const sf_manifest_origin *here);
/* Name of the picture and camera: what a view is of, rendered or not. */
sf_status sf_manifest_same_camera(const sf_manifest_view *wanted, const char *name, const sf_camera *here);
/* Camera, size, planes, counts; not name, file and quality. *plane: the first plane that differs, or -1. */
sf_status sf_manifest_same_view(const sf_manifest_view *wanted, const sf_manifest_view *here, int *plane);

void sf_manifest_hash_camera(const sf_camera *camera, char hex[65]); /* camera_sha256 */
/* Fills size, hashes and counts from a rendered picture. */
sf_status sf_manifest_describe(sf_manifest_view *view, const fx_net *net, const sf_camera *camera,
                               const sf_golden *golden);

/* Quality and counts per view, means and totals: a table, or JSON. */
void sf_manifest_report_print(FILE *out, const sf_manifest *manifest);
cJSON *sf_manifest_report_json(const sf_manifest *manifest);

/* The integer planes of an EXR file against a picture: SF_E_DIFFERENCE names the first plane and pixel (of the picture,
 * from 0, 0) that differ and both values. plane -1: all of them. */
sf_status sf_golden_compare_file(const sf_golden *golden, const char *path, int plane);
#endif
