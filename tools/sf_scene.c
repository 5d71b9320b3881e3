/* Makes a procedural scene: pictures and camera poses in the Blender layout. */
#include "cli/cli.h"
#include "base/clock.h"
#include "scene/scene.h"
#include <stdio.h>

typedef struct scene_args {
  const char *output;
  int size, train, test;
  uint64_t seed;
  bool list, quiet;
} scene_args;

static bool show_progress(void *user, int done, int total)
{
  sf_progress *progress = user;
  if (done == total || sf_progress_due(progress))
    sf_progress_show(progress, "rendering: %d of %d pictures", done, total);
  return !sf_cli_interrupted();
}

static void print_names(void)
{
  for (int i = 0; sf_procedural_names[i]; i++) printf("%s\n", sf_procedural_names[i]);
}

static sf_status make_scene(const scene_args *args, const char *name)
{
  if (!name) return sf_fail(SF_E_USAGE, "missing argument NAME; --list shows the scenes");
  if (!args->output) return sf_fail(SF_E_USAGE, "missing option -o DIR");
  sf_procedural_options options = {args->size, args->size, args->train, args->test, args->seed};
  sf_progress progress;
  double start = sf_seconds();
  sf_cli_catch_signals();
  sf_progress_begin(&progress, args->quiet);
  sf_status status = sf_procedural_write(name, args->output, &options, show_progress, &progress);
  sf_progress_end(&progress);
  if (status.code == SF_OK && !args->quiet)
    printf("%s: %d train and %d test views of %d x %d pixels in %s (%.1f s)\n", name, args->train, args->test,
           args->size, args->size, args->output, sf_seconds() - start);
  return status;
}

int main(int argc, char **argv)
{
  scene_args args = {.size = 200, .train = 60, .test = 10, .seed = 1};
  const sf_option options[] = {
      {"--output", 'o', SF_ARG_PLACE, &args.output, 0, 0, NULL, "DIR", "folder to fill; made where it is missing"},
      {"--size", 0, SF_ARG_INT, &args.size, 1, 8192, NULL, "N", "width and height of each picture (default 200)"},
      {"--train", 0, SF_ARG_INT, &args.train, 1, 10000, NULL, "N", "views to learn from (default 60)"},
      {"--test", 0, SF_ARG_INT, &args.test, 1, 10000, NULL, "N", "views held out (default 10)"},
      {"--seed", 's', SF_ARG_U64, &args.seed, 0, 0, NULL, "N", "camera positions (default 1)"},
      {"--list", 'l', SF_ARG_FLAG, &args.list, 0, 0, NULL, NULL, "print the names of the scenes"},
      {"--quiet", 'q', SF_ARG_FLAG, &args.quiet, 0, 0, NULL, NULL, "print errors only"},
      {0}};
  const sf_cli cli = {
      .program = "sf_scene",
      .usage = "sf_scene NAME -o DIR [options]",
      .summary = "Renders a scene of analytic shapes exactly: transforms_{train,test}.json and RGBA pictures.\n\n"
                 "Scenes:\n"
                 "  textured   toys on a checkered plinth: thin rails, a flag, shine that follows the eye\n"
                 "  simple     matt spheres and boxes\n"
                 "  fog        homogeneous fog around a shiny core\n"
                 "  plaza      bricks among towers under a sky, cameras inside: train with --bound 8\n"
                 "  wires      a fence, stays and a coiled cable, one to two pixels wide\n"
                 "  terrazzo   speckled stones: COLMAP finds its cameras (sf_data --solve)\n"
                 "  empty      nothing: every picture is transparent",
      .examples = "  sf_scene textured -o scene\n"
                  "  sf_scene fog -o scene --size 100 --train 40 --test 5 --seed 7",
      .options = options,
      .max_positional = 1,
      .words = true,
  };
  const char *name;
  sf_status status = sf_cli_parse(&cli, argc, argv, &name);
  if (status.code == SF_OK && args.list)
    print_names();
  else if (status.code == SF_OK)
    status = make_scene(&args, name);
  return sf_cli_finish(&cli, status);
}
