/* sf_point: what one choice of widths costs a model in picture quality, energy and bytes. */
#include "cli/cli.h"
#include "sweep/sweep.h"
#include <omp.h>

int main(int argc, char **argv)
{
  sf_point_options o = {.split = "test", .every = 1, .quant.background = {1, 1, 1}};
  sf_quant_widths *w = &o.quant.widths;
  int threads = 0;
  bool json = false;
  const sf_option options[] = {
      SF_GROUP("What to render"),
      {"--view", 0, SF_ARG_INT, &o.view, 0, 1 << 20, NULL, "K", "view of the split, from 0 (default 0)"},
      {"--split", 0, SF_ARG_STRING, &o.split, 0, 0, NULL, "NAME", "train or test (default test)"},
      {"--every", 0, SF_ARG_INT, &o.every, 1, 64, NULL, "N", "every Nth pixel along both axes (default 1)"},
      {"--steps", 0, SF_ARG_INT, &o.quant.steps, 1, SF_T_MAX, NULL, "N", "time steps (default: the model's t_r)"},
      SF_GROUP("Widths"),
      {"--weight-bits", 0, SF_ARG_INT, &w->weight_bits, 2, SF_WEIGHT_BITS, NULL, "B", "bits of a weight"},
      {"--feature-bits", 0, SF_ARG_INT, &w->feature_bits, 8, SF_INPUT_BITS, NULL, "B",
       "bits of inputs of D1 and C1; hash grids alone"},
      {"--leak-bits", 0, SF_ARG_INT, &w->leak_bits, 4, SF_LEAK_FRAC, NULL, "B", "fraction bits of a leak"},
      {"--grid-bits", 0, SF_ARG_INT, &w->grid_bits, 2, SF_GRID_BITS, NULL, "B",
       "bits of an entry of the grid, or of planes and lines"},
      SF_GROUP("Tuning"),
      {"--seed", 0, SF_ARG_U64, &o.quant.seed, 0, 0, NULL, "S", "seed of the calibration samples (default 0)"},
      {"--threads", 0, SF_ARG_INT, &threads, 1, 1024, NULL, "N", "threads (default: all processors)"},
      {"--json", 0, SF_ARG_FLAG, &json, 0, 0, NULL, NULL, "report as JSON"},
      {0}};
  const sf_cli cli = {
      .program = "sf_point",
      .usage = "sf_point model.safetensors DATA [options]",
      .summary =
          "Quantises a model at some widths, renders a view in float and in fixed point and prints what the widths\n"
          "cost: PSNR against float and against the picture, energy, bytes, saturations, speed.",
      .examples = "  sf_point model.safetensors data --weight-bits 6 --every 4\n"
                  "  sf_point model.safetensors data --grid-bits 5 --steps 2 --json\n",
      .options = options,
      .min_positional = 2,
      .max_positional = 2};
  const char *positional[2] = {NULL, NULL};
  sf_point point;
  sf_status status = sf_cli_parse(&cli, argc, argv, positional);
  o.model = positional[0], o.data = positional[1];
  if (status.code == SF_OK && threads) omp_set_num_threads(threads);
  if (status.code == SF_OK) status = sf_point_measure(&point, &o);
  if (status.code == SF_OK && json) status = sf_json_print(sf_point_json(&point), true);
  if (status.code == SF_OK && !json) sf_point_print(stdout, &point);
  if (status.code == SF_OK && fflush(stdout)) status = sf_fail(SF_E_IO, "standard output: the report was not written");
  return sf_cli_finish(&cli, status);
}
