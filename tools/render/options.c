#include "tools/render/options.h"
#include "sim/studio/studio.h"
#include <string.h>
#include <strings.h>

enum { SEED = 1 };
static const uint64_t NO_SEED = UINT64_MAX; /* not given */
static const double SEED_MAX = 1e19;

sf_cli render_cli(void)
{
  return (sf_cli){
      .program = "sim_render",
      .usage = "sim_render scene.snn DATA [--view K] -o golden.exr | --all -o DIR | --verify MANIFEST [options]",
      .summary =
          "Renders views through the float field, the fixed-point core or the Verilog accelerator, simulated (rtl) or "
          "on a board.\n"
          "EXR channels: R G B A, Z (mean distance, world units; forward-facing data: NDC), samples;\n"
          "fixed, rtl and board also spikes, sops, macs, energy_fJ and the raw integers fx.R fx.G fx.B fx.A fx.T "
          "fx.Zhi fx.Zlo.\n"
          "--all renders a whole split and goes on where it was interrupted; DIR/manifest.json holds what must be\n"
          "equal on any machine (src/golden/manifest.h). --verify names the first difference, exit status 1.",
      .examples = "  sim_render scene.snn data --view 3 -o golden.exr --png preview.png\n"
                  "  sim_render scene.snn data --backend rtl --crop 40,40,16,16 -o rtl.exr\n"
                  "  sim_render scene.snn data --backend board --port /dev/ttyUSB0 -o board.exr\n"
                  "  sim_render scene.snn data --all -o golden\n"
                  "  mpirun -n 8 sim_render scene.snn data --all -o golden\n"
                  "  sim_render scene.snn data --verify golden/manifest.json --view 7\n"
                  "  sim_render scene.snn data --all --crop 40,40,16,16 -o small\n"
                  "  sim_render scene.snn data --verify small/manifest.json --backend rtl\n"
                  "  sim_render scene.snn data --verify small/manifest.json --backend rtl --dut \"-F kit/rtl.f\"\n",
      .min_positional = 1,
      .max_positional = 2};
}

static sf_status refuse(bool given, const char *option, const char *reason)
{
  return given ? sf_fail(SF_E_USAGE, "%s %s", option, reason) : sf_ok();
}

/* Options that only one backend reads. */
static sf_status check_backend(render_options *o)
{
  SF_TRY(refuse(o->model && o->backend != SF_BACKEND_FLOAT, "--model", "needs --backend float"));
  SF_TRY(refuse(o->seed != NO_SEED && o->backend != SF_BACKEND_RTL, "--seed", "needs --backend rtl"));
  SF_TRY(refuse(o->dut && o->backend != SF_BACKEND_RTL, "--dut", "needs --backend rtl"));
  SF_TRY(refuse(o->dut && sf_ranks_launched() > 1, "--dut", "is for a program that no launcher started"));
  SF_TRY(refuse(o->dut_top && !o->dut, "--dut-top", "belongs to --dut"));
  if (!o->dut_top) o->dut_top = "sf_ray_top";
  SF_TRY(refuse(o->kernels && o->backend != SF_BACKEND_FIXED, "--kernels", "needs --backend fixed"));
  SF_TRY(refuse(o->port && o->backend != SF_BACKEND_BOARD, "--port", "needs --backend board"));
  SF_TRY(refuse(o->patience > 0 && o->backend != SF_BACKEND_BOARD, "--timeout", "needs --backend board"));
  SF_TRY(refuse(!o->port && o->backend == SF_BACKEND_BOARD, "--backend board", "needs --port, such as /dev/ttyUSB0"));
  if (!(o->patience > 0)) o->patience = SF_BOARD_PATIENCE;
  if (o->seed == NO_SEED) o->seed = SEED;
  return sf_ok();
}

static sf_status check_modes(render_options *o)
{
  SF_TRY(check_backend(o));
  SF_TRY(refuse(!o->all && !o->verify && sf_ranks_launched() > 1, "--all", "or --verify has to be given to ranks"));
  const char *const alone = "goes with one view: without --view, --all, --verify and --truth";
  SF_TRY(refuse(o->camera && (o->view >= 0 || o->all || o->verify || o->truth), "--camera", alone));
  if (!o->data && !o->camera) return sf_fail(SF_E_USAGE, "DATA is missing: only --camera does without");
  if (o->verify) return refuse(o->backend == SF_BACKEND_FLOAT, "--backend float", "cannot verify: it has no integers");
  if (!o->output) return sf_fail(SF_E_USAGE, o->all ? "-o DIR is missing" : "-o FILE is missing");
  if (o->all) {
    SF_TRY(refuse(o->view >= 0, "--view", "does not go with --all"));
    SF_TRY(refuse(o->png, "--png", "does not go with --all"));
    SF_TRY(refuse(o->truth, "--truth", "does not go with --all"));
    SF_TRY(
        refuse(o->backend == SF_BACKEND_RTL && !o->crop, "--all --backend rtl", "needs --crop: whole views take days"));
  }
  const char *dot = strrchr(o->output, '.');
  if (!o->all) SF_TRY(refuse(dot && !strcasecmp(dot, ".png"), o->output, "would hold an EXR: --png is for previews"));
  if (!o->split) o->split = "test";
  if (o->view < 0) o->view = 0;
  return sf_ok();
}

sf_status render_parse(int argc, char **argv, render_options *o, sf_cli *cli)
{
  *o = (render_options){.view = -1, .backend = SF_BACKEND_FIXED, .seed = NO_SEED};
  const sf_option table[] = {
      SF_GROUP("One view"),
      {"--output", 'o', SF_ARG_PLACE, &o->output, 0, 0, NULL, "FILE", "EXR to write; with --all: folder"},
      {"--png", 0, SF_ARG_OUTPUT, &o->png, 0, 0, NULL, "FILE", "also a PNG preview"},
      {"--truth", 0, SF_ARG_OUTPUT, &o->truth, 0, 0, NULL, "FILE", "also the view's own picture, PNG"},
      {"--view", 0, SF_ARG_INT, &o->view, 0, 1 << 20, NULL, "K",
       "which view of the split, from 0 (default 0; --verify: all)"},
      {"--camera", 0, SF_ARG_STRING, &o->camera, 0, 0, NULL, "NUMBERS",
       "in place of --view: W,H,FX,FY,CX,CY and the pose's 3 x 4 numbers, as sf_view prints them; DATA may be left "
       "out"},
      {"--crop", 0, SF_ARG_STRING, &o->crop, 0, 0, NULL, "X,Y,W,H",
       "only this window (rtl default: 16x16 in the centre)"},
      {"--split", 0, SF_ARG_STRING, &o->split, 0, 0, NULL, "NAME", "train or test (default test)"},
      SF_GROUP("A set of views"),
      {"--all", 0, SF_ARG_FLAG, &o->all, 0, 0, NULL, NULL,
       "every view of the split, into the folder -o, with a manifest and a contact sheet; also as ranks of mpirun or "
       "srun (docs/scale.md)"},
      {"--verify", 0, SF_ARG_INPUT, &o->verify, 0, 0, NULL, "MANIFEST",
       "render again what the manifest lists and compare"},
      SF_GROUP("How it is computed"),
      {"--backend", 0, SF_ARG_CHOICE, &o->backend, 0, 0, "float|fixed|rtl|board", "B", "arithmetic (default fixed):"},
      {"--steps", 0, SF_ARG_INT, &o->steps, 1, SF_T_MAX, NULL, "N", "time steps (default: the scene's t_r)"},
      {"--model", 0, SF_ARG_INPUT, &o->model, 0, 0, NULL, "FILE",
       "for float (default model.safetensors beside the scene)"},
      {"--port", 0, SF_ARG_STRING, &o->port, 0, 0, NULL, "DEVICE", "board: its serial port, such as /dev/ttyUSB0"},
      {"--timeout", 0, SF_ARG_DOUBLE, &o->patience, 0.01, 600, NULL, "S",
       "board: seconds without a byte until a command is sent again (default 1)"},
      {"--kernels", 0, SF_ARG_STRING, &o->kernels, 0, 0, NULL, "NAME",
       "instructions of fixed: portable, avx2, avx512vnni or amx (default: the fastest here); the result is the same"},
      {"--threads", 0, SF_ARG_INT, &o->threads, 1, 1024, NULL, "N",
       "threads, at most one a processor (default: all processors)"},
      SF_GROUP("Tuning"),
      {"--downscale", 0, SF_ARG_INT, &o->downscale, 0, 64, NULL, "N",
       "views of 1/N of the full size, 0 = by the layout (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &o->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the scene's (default 0)"},
      {"--seed", 0, SF_ARG_U64, &o->seed, 0, SEED_MAX, NULL, "S",
       "rtl: seed of the registers' contents at power-on (default 1)"},
      SF_GROUP("Another block"),
      {"--dut", 0, SF_ARG_STRING, &o->dut, 0, 0, NULL, "FILES",
       "rtl: another block with the ports of rtl/sf_ray_top.sv: Verilog sources, options of Verilator, -F LIST "
       "(docs/kit.md)"},
      {"--dut-top", 0, SF_ARG_STRING, &o->dut_top, 0, 0, NULL, "NAME", "its module (default sf_ray_top)"},
      SF_GROUP("What is printed"),
      {"--json", 0, SF_ARG_FLAG, &o->json, 0, 0, NULL, NULL, "report as JSON"},
      {"--quiet", 'q', SF_ARG_FLAG, &o->quiet, 0, 0, NULL, NULL, "no progress line"},
      {0}};
  static const char *const of_manifest[] = {"--all",   "--output", "--png",       "--truth", "--crop",
                                            "--steps", "--split",  "--downscale", "--scale", NULL};
  static const char *const of_data[] = {"--split", "--downscale", "--scale", NULL};
  const char *positional[2];
  cli->options = table;
  sf_status status = sf_cli_parse(cli, argc, argv, positional);
  if (status.code == SF_OK && o->verify)
    status = sf_cli_refuse(cli, argc, argv, of_manifest, "does not go with --verify: the manifest decides");
  else if (status.code == SF_OK && o->camera && !positional[1])
    status = sf_cli_refuse(cli, argc, argv, of_data, "is about a data set, and none is named");
  cli->options = NULL;
  SF_TRY(status);
  o->scene = positional[0], o->data = positional[1];
  return check_modes(o);
}
