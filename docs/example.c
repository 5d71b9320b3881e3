/* Renders a scene with libspikefield and looks inside the ray through the middle of the picture.
 *
 *   cc docs/example.c $(pkg-config --cflags --libs spikefield) -o example
 *   ./example scene.snn picture.ppm 400 */
#include <inttypes.h>
#include <spikefield/spikefield.h>
#include <stdio.h>
#include <stdlib.h>

static bool show_progress(void *user, uint64_t done, uint64_t total)
{
  (void)user;
  fprintf(stderr, "\r%3d %%%s", (int)(100 * done / total), done == total ? "\n" : "");
  return true; /* false would stop the work */
}

/* 3.2 model units from the middle of the scene, 37 degrees above the horizon; z is up. */
static spikefield_camera make_camera(int width)
{
  const float focal = 1.25f * (float)width, middle = 0.5f * (float)width;
  return (spikefield_camera){.width = width,
                             .height = width,
                             .fx = focal,
                             .fy = focal,
                             .cx = middle,
                             .cy = middle,
                             .to_model = {1, 0, 0, 0, 0, 0.6f, -0.8f, -2.5625f, 0, 0.8f, 0.6f, 1.921875f}};
}

/* 16 bits per channel: the fixed-point pixels, bit for bit. */
static bool write_picture(const char *path, const spikefield_pixel *pixel, int width)
{
  FILE *file = fopen(path, "wb");
  if (!file) return false;
  fprintf(file, "P6\n%d %d\n65535\n", width, width);
  for (int i = 0; i < width * width; i++)
    for (int c = 0; c < 3; c++) fputc((int)(pixel[i].rgba[c] >> 8), file), fputc((int)(pixel[i].rgba[c] & 255), file);
  const bool whole = !ferror(file);
  return !fclose(file) && whole;
}

/* How many neurons of the first layer fired, time step by time step. */
static bool show_sample(void *user, const spikefield_tap *tap)
{
  const int steps = *(const int *)user;
  printf("  sample %2" PRIu32 ": density %8.2f, spikes in D1", tap->index, tap->sample->density / 4096.0);
  for (int t = 0; t < steps; t++) {
    int fired = 0;
    for (int n = 0; n < SPIKEFIELD_LANES; n++)
      fired += (int)(tap->trace->spikes[SPIKEFIELD_D1][t][n / 64] >> n % 64 & 1);
    printf(" %3d", fired);
  }
  printf("\n");
  return true;
}

static spikefield_status run(const spikefield_scene *scene, int width, spikefield_pixel *pixel, const char *path)
{
  const spikefield_options options = {.progress = show_progress};
  const spikefield_camera camera = make_camera(width);
  const float *m = camera.to_model, origin[3] = {m[3], m[7], m[11]}, ahead[3] = {-m[2], -m[6], -m[10]};
  spikefield_counts counts = {0};
  spikefield_scene_info info;
  spikefield_status status = spikefield_scene_describe(scene, &info);
  if (status.code == SPIKEFIELD_OK) status = spikefield_frame(scene, &options, &camera, pixel, &counts);
  if (status.code != SPIKEFIELD_OK) return status;
  if (!write_picture(path, pixel, width)) return (spikefield_status){SPIKEFIELD_E_IO, "cannot write the picture"};
  printf("spikefield %s: %d time steps, %" PRIu64 " samples\n", spikefield_version(), (int)info.steps, counts.samples);
  printf("energy %" PRIu64 " fJ, of its ReLU twin %" PRIu64 " fJ\n", spikefield_energy_fj(&counts),
         spikefield_relu_energy_fj(scene, counts.samples));
  printf("the middle ray:\n");
  int steps = info.steps;
  return spikefield_ray_taps(scene, NULL, origin, ahead, show_sample, &steps, pixel, NULL);
}

int main(int argc, char **argv)
{
  const int width = argc > 3 ? atoi(argv[3]) : 200;
  if (argc < 3 || width < 1 || width > 4096) {
    fprintf(stderr, "usage: example SCENE.snn PICTURE.ppm [WIDTH]\n");
    return 2;
  }
  spikefield_scene *scene;
  spikefield_pixel *pixel = malloc((size_t)width * (size_t)width * sizeof *pixel);
  spikefield_status status = spikefield_scene_open(&scene, argv[1]);
  if (status.code == SPIKEFIELD_OK && pixel) status = run(scene, width, pixel, argv[2]);
  if (status.code != SPIKEFIELD_OK) fprintf(stderr, "example: %s\n", status.message);
  if (!pixel) fprintf(stderr, "example: no memory for %d x %d pixels\n", width, width);
  spikefield_scene_close(scene);
  free(pixel);
  return status.code != SPIKEFIELD_OK || !pixel;
}
