/* For the tests of readers: what they found, and the words with which they refuse, as lines of a text. */
#ifndef SF_TESTS_READER_FIXTURE_H
#define SF_TESTS_READER_FIXTURE_H
#include "src/scene/capture.h"
#include "tests/expected.h"
#include <math.h>

/* Without the folder's name, which changes. */
static inline void say_status(FILE *out, sf_status status)
{
  if (!status.code) return;
  fprintf(out, "  %d ", status.code);
  for (const char *at = status.message; *at;)
    if (!strncmp(at, folder, strlen(folder)))
      at += strlen(folder), fputc('~', out);
    else
      fputc(*at++, out);
  fprintf(out, "\n");
}

static inline void say_lens(FILE *out, const sf_lens *l)
{
  fprintf(out, "  lens %g %g centre %g%s %g%s size %g %g angle %g %g bend %g %g %g %g %s of %d\n", l->fl_x, l->fl_y,
          l->cx, l->has_cx ? "!" : "", l->cy, l->has_cy ? "!" : "", l->width, l->height, l->angle_x, l->angle_y, l->k1,
          l->k2, l->p1, l->p2, l->model ? l->model : "-", (int)l->camera);
}

static inline void say_frame(FILE *out, const sf_frame *f)
{
  fprintf(out, "  %d '%s'%s", f->number, f->file_path, f->own_size ? " of its own size" : "");
  for (int i = 0; i < 12; i++) fprintf(out, " %.7g", rint(f->to_world[i] * 1e8) / 1e8 + 0.0);
  fprintf(out, "\n");
  say_lens(out, &f->lens);
}
#endif
