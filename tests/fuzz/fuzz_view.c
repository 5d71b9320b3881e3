/* Parameters of a request to sf_view, one a line: KEY=VALUE; a line "HOST ORIGIN" behind a space. */
#include "fuzz.h"
#include "view/view.h"
#include <math.h>

static void expect_ranges(const sf_view_ask *a)
{
  FUZZ_EXPECT(a->view >= -1 && a->view <= 1 << 20);
  FUZZ_EXPECT(a->steps == -1 || (a->steps >= 1 && a->steps <= SF_T_MAX));
  FUZZ_EXPECT(a->stride == -1 || (a->stride >= 1 && a->stride <= SF_VIEW_STRIDE));
  FUZZ_EXPECT(a->source >= 0 && a->source < SF_VIEW_SOURCES && a->finish >= -1 && a->finish <= 1);
  FUZZ_EXPECT(a->x >= -1 && a->x < SF_VIEW_SIDE && a->y >= -1 && a->y < SF_VIEW_SIDE);
  FUZZ_EXPECT(a->layer >= -1 && a->layer < SF_LAYERS && a->neuron >= -1 && a->neuron < SF_LANES);
  FUZZ_EXPECT(a->sample >= -1 && a->sample <= SF_VIEW_SAMPLES);
  FUZZ_EXPECT(strlen(a->map) <= SF_VIEW_WORD && strlen(a->kind) <= SF_VIEW_WORD);
  for (int i = 0; i < 4; i++) FUZZ_EXPECT(a->window[i] >= 0 && a->window[i] <= SF_VIEW_SIDE);
}

static void expect_camera(const sf_view_ask *a)
{
  char text[SF_CAMERA_TEXT], again[SF_CAMERA_TEXT];
  sf_camera camera;
  if (!a->has_camera) return;
  FUZZ_EXPECT(a->camera.width >= 1 && a->camera.width <= SF_VIEW_SIDE && a->camera.fx > 0);
  for (int i = 0; i < 12; i++) FUZZ_EXPECT(isfinite(a->camera.to_world[i]));
  sf_camera_print(&a->camera, text);
  FUZZ_EXPECT(fuzz_good(sf_camera_parse(text, &camera)));
  sf_camera_print(&camera, again);
  FUZZ_EXPECT(!strcmp(text, again));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
  char *text = malloc(size + 1), *rest = text;
  sf_view_ask ask;
  FUZZ_EXPECT(text);
  memcpy(text, data, size);
  text[size] = 0;
  sf_view_ask_begin(&ask);
  for (char *line; (line = strsep(&rest, "\n"));) {
    char *value = line;
    if (*line == ' ') {
      strsep(&value, " ");
      char *host = strsep(&value, " ");
      (void)sf_view_is_own(host, value);
      continue;
    }
    strsep(&value, "=");
    (void)fuzz_good(sf_view_ask_add(&ask, line, value));
  }
  expect_ranges(&ask);
  expect_camera(&ask);
  free(text);
  return 0;
}
