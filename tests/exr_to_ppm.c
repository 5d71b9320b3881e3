/* The fixed-point pixels of a golden image as a 16-bit PPM on stdout: exr_to_ppm GOLDEN.exr */
#include "image/image.h"
#include <stdio.h>
#include <string.h>

static const uint32_t *find(const sf_exr_channel *channel, int n, const char *name)
{
  for (int i = 0; i < n; i++)
    if (!strcmp(channel[i].name, name) && channel[i].type == SF_EXR_UINT) return channel[i].data;
  return NULL;
}

int main(int argc, char **argv)
{
  sf_exr_channel *channel;
  int width, height, n;
  if (argc != 2) return 2;
  const sf_status status = sf_exr_load(argv[1], &width, &height, &channel, &n);
  if (status.code != SF_OK) {
    fprintf(stderr, "exr_to_ppm: %s\n", status.message);
    return 1;
  }
  const uint32_t *plane[3] = {find(channel, n, "fx.R"), find(channel, n, "fx.G"), find(channel, n, "fx.B")};
  const int whole = plane[0] && plane[1] && plane[2];
  if (whole) printf("P6\n%d %d\n65535\n", width, height);
  for (size_t i = 0; whole && i < (size_t)width * (size_t)height; i++)
    for (int c = 0; c < 3; c++) putchar((int)(plane[c][i] >> 8)), putchar((int)(plane[c][i] & 255));
  sf_exr_free(channel, n);
  return !whole || fflush(stdout);
}
