/* sf_view: a scene in the browser. */
#include "sim/view/viewer.h"
#include "cli/cli.h"
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct options {
  sf_viewer_options viewer;
  sf_view_options server;
  double scale;
  bool json, quiet, no_browser;
} options;

static sf_status print_json(sf_viewer *viewer, const sf_view_server *server)
{
  cJSON *json = sf_viewer_json(viewer);
  cJSON_DeleteItemFromObject(json, "palette"), cJSON_DeleteItemFromObject(json, "maps");
  cJSON_AddStringToObject(json, "url", sf_view_url(server));
  SF_TRY(sf_json_print(json, false));
  return fflush(stdout) == 0 ? sf_ok() : sf_fail(SF_E_IO, "standard output: cannot write the address");
}

static sf_status serve(const options *o, sf_viewer *viewer, const sf_view_server *server)
{
  if (o->json)
    SF_TRY(print_json(viewer, server));
  else
    printf("%s\n", sf_view_url(server));
  if (!o->json && !o->quiet) printf("Open it in a browser on this machine. Ctrl-C ends it.\n");
  if (fflush(stdout)) return sf_fail(SF_E_IO, "standard output: cannot write the address");
  if (!o->no_browser) sf_view_browse(server);
  while (!sf_cli_interrupted()) nanosleep(&(struct timespec){.tv_nsec = 50000000}, NULL);
  return sf_ok();
}

static sf_status run(options *o)
{
  sf_viewer *viewer;
  sf_view_server *server = NULL;
  sf_status status = sf_viewer_open(&viewer, &o->viewer);
  if (status.code == SF_OK) {
    sf_viewer_warn(viewer, stderr, "sf_view");
    o->server.routes = sf_viewer_routes, o->server.user = viewer;
    status = sf_view_open(&server, &o->server);
  }
  if (status.code == SF_OK) status = serve(o, viewer, server);
  sf_view_close(server);
  sf_viewer_close(viewer);
  return status;
}

static sf_status parse(int argc, char **argv, options *o, sf_cli *cli)
{
  sf_viewer_options *v = &o->viewer;
  const sf_option table[] = {
      SF_GROUP("What is shown"),
      {"--model", 0, SF_ARG_INPUT, &v->model, 0, 0, NULL, "FILE",
       "the float model that the scene was made of: a source too"},
      {"--replay", 0, SF_ARG_INPUT, &v->replay, 0, 0, NULL, "FILE",
       "a difference that sf_cosim wrote, such as sf_cosim-difference.json; it names the scene"},
      {"--split", 0, SF_ARG_STRING, &v->split, 0, 0, NULL, "NAME", "views of train or test (default test)"},
      {"--steps", 0, SF_ARG_INT, &v->steps, 1, SF_T_MAX, NULL, "N",
       "time steps to begin with (default: the scene's t_r)"},
      {"--downscale", 0, SF_ARG_INT, &v->downscale, 0, 64, NULL, "N",
       "views of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the scene's (default 0)"},
      SF_GROUP("Where it is served"),
      {"--port", 0, SF_ARG_INT, &o->server.port, 0, 65535, NULL, "N", "0: a free one (default 0)"},
      {"--address", 0, SF_ARG_STRING, &o->server.address, 0, 0, NULL, "A",
       "to listen on, in numbers; others than 127.0.0.1 are reached from outside (default 127.0.0.1)"},
      {"--no-browser", 0, SF_ARG_FLAG, &o->no_browser, 0, 0, NULL, NULL, "print the address alone, and open nothing"},
      SF_GROUP("What is printed"),
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "the address and what is shown, as one line of JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "the address alone"},
      {0}};
  const char *positional[2];
  cli->options = table;
  static const char *const of_data[] = {"--split", "--downscale", "--scale", NULL};
  sf_status status = sf_cli_parse(cli, argc, argv, positional);
  if (status.code == SF_OK && positional[0] && !positional[1])
    status = sf_cli_refuse(cli, argc, argv, of_data, "is about a data set, and none is named");
  cli->options = NULL;
  SF_TRY(status);
  v->scene = positional[0], v->data = positional[1], v->scale = (float)o->scale;
  if (!v->scene && !v->replay) return sf_fail(SF_E_USAGE, "SCENE.snn is missing");
  if (v->scene && v->replay) return sf_fail(SF_E_USAGE, "--replay takes neither scene nor data: its file names them");
  return sf_ok();
}

int main(int argc, char **argv)
{
  options o = {0};
  sf_cli cli = {
      .program = "sf_view",
      .usage = "sf_view scene.snn [DATA] [--model model.safetensors] [--port N] [options]",
      .summary =
          "Shows a scene in a browser on this machine: orbit, move t_r, look at what each pixel costs, click on\n"
          "one to follow its ray through every sample, layer and neuron. Prints the address, which has a\n"
          "secret in it, and opens it where there is a display. Nothing leaves this machine.",
      .examples = "  sf_view scene.snn data\n"
                  "  sf_view scene.snn data --model model.safetensors\n"
                  "  sf_view scene.snn --port 8323 --no-browser\n"
                  "  sf_view --replay sf_cosim-difference.json\n",
      .max_positional = 2};
  sf_status status = parse(argc, argv, &o, &cli);
  if (status.code == SF_OK) {
    sf_cli_catch_signals();
    status = run(&o);
  }
  return sf_cli_finish(&cli, status);
}
