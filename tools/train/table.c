/* The options of sf_train, group by group: what a first run needs, tuning, ablations last. */
#include "tools/train/options.h"
#include "field/field.h"

/* After the help text stand the defaults of the two backbones, ingp and tensorf. A single default is that of both. #
 * stands for the number that train_defaults sets. */
#define COUNT(list) (sizeof(list) / sizeof *(list))

static sf_option *first_run(train_arguments *a, sf_option *o)
{
  const sf_option list[] = {
      SF_GROUP("A first run"),
      {"--output", 'o', SF_ARG_OUTPUT, &a->output, 0, 0, NULL, "FILE", "model to write (default model.safetensors)"},
      {"--minutes", 'm', SF_ARG_DOUBLE, &a->train.minutes, 0, 1e5, NULL, "M",
       "time to learn, a quarter of it for stage I; loading and the evaluation at the end are not counted (default: "
       "--stage1 and --stage2 iterations)"},
      {"--backbone", 0, SF_ARG_CHOICE, &a->train.config.backbone, 0, 0, "ingp|tensorf", "KIND",
       "hash grid, or TensoRF's planes and lines (default ingp)"},
      {"--resume", 'r', SF_ARG_FLAG, &a->resume, 0, 0, NULL, NULL,
       "continue from the checkpoint at --output, with the options of its run"},
      {"--threads", 'j', SF_ARG_INT, &a->threads, 0, 1024, NULL, "N", "threads, 0 = all (default 0)"},
      {"--seed", 's', SF_ARG_U64, &a->train.seed, 0, 9e15, NULL, "S",
       "same seed, same bits, any thread count (default 1)"},
      {"--view", 0, SF_ARG_INT, &a->view, 0, 65535, NULL, "PORT",
       "show the training on a page of this machine, at this port, 0 = a free one; its address is printed"},
      {"--quiet", 'q', SF_ARG_FLAG, &a->quiet, 0, 0, NULL, NULL, "no progress line"},
      {"--json", 0, SF_ARG_FLAG, &a->json, 0, 0, NULL, NULL, "print the closing summary as JSON"}};
  return sf_cli_add(o, list, COUNT(list));
}

static sf_option *energy(train_arguments *a, sf_option *o)
{
  sf_train_options *t = &a->train;
  const sf_option list[] = {
      SF_GROUP("Quality against energy"),
      {"--beta", 'b', SF_ARG_DOUBLE, &t->beta, 0, 1, NULL, "B",
       "quality (small) against energy (large) (default 5e-7)"},
      {"--target-loss", 0, SF_ARG_DOUBLE, &t->target_loss, 0, 20, NULL, "DB",
       "in place of --beta: the fewest steps that are at most so far behind the best number of steps"},
      {"--target-saving", 0, SF_ARG_DOUBLE, &t->target_saving, 0, 100, NULL, "PERCENT",
       "in place of --beta: the most steps that save so much of the ReLU twin's energy"},
      {"--price", 0, SF_ARG_CHOICE, &t->price, 0, 0, "exponential|energy", "KIND",
       "what beta weighs: e^t, as the paper, or what one more step costs here, mJ per frame (default exponential)"},
      {"--charge", 0, SF_ARG_DOUBLE, &t->charge, 0, 10, NULL, "C",
       "once the steps are found, neurons learn to fire less: the error may grow by C percent for each percent of "
       "fewer reads of weights; 0.2 is a good start (default 0)"},
      {"--opaque", 0, SF_ARG_DOUBLE, &t->opaque, 0, 10, NULL, "C",
       "rays learn to end soon in a surface: the error may grow by C percent for each percent of fewer samples; "
       "0: rays as long as the paper's (default 0.5)"},
      {"--undecoded", 0, SF_ARG_DOUBLE, &t->undecoded, 0, 0.1, NULL, "X",
       "tensorf: faint samples are not decoded, as many as together take this share of the light, fewer where the "
       "error "
       "is small; 0: those of a weight up to TensoRF's 1e-4 (default 0.01)"},
      {"--steps", 'T', SF_ARG_INT, &t->config.steps, 1, SF_T_MAX, NULL, "T",
       "time steps unrolled in training (default 8)"},
      {"--fine-tune", 0, SF_ARG_INPUT, &a->fine_tune, 0, 0, NULL, "MODEL",
       "start from this trained model, at its t_r, with its numbers rounded as sf_export does; stage II alone"},
      {"--weight-bits", 0, SF_ARG_INT, &a->weight_bits, 2, SF_WEIGHT_BITS, NULL, "B",
       "of --fine-tune: bits of a weight (default 8)"},
      {"--leak-bits", 0, SF_ARG_INT, &a->leak_bits, 4, SF_LEAK_FRAC, NULL, "B",
       "of --fine-tune: fraction bits of a leak (default 12)"},
      {"--grid-bits", 0, SF_ARG_INT, &a->grid_bits, 2, SF_GRID_BITS, NULL, "B",
       "of --fine-tune: bits of an entry of the grid, or of planes and lines (default 8)"}};
  return sf_cli_add(o, list, COUNT(list));
}

static sf_option *data_and_box(train_arguments *a, sf_option *o)
{
  const sf_option list[] = {
      SF_GROUP("The data and its box"),
      {"--downscale", 'd', SF_ARG_INT, &a->downscale, 0, 64, NULL, "F",
       "images of 1/F of the full size, 0 = by the layout (default 0)"},
      {"--limit", 0, SF_ARG_INT, &a->limit, 0, 1e6, NULL, "N", "use the first N training views, 0 = all (default 0)"},
      {"--scale", 0, SF_ARG_DOUBLE, &a->scale, 0, 1e6, NULL, "S",
       "model units per world unit, 0 = the layout's (default 0)"},
      {"--bound", 0, SF_ARG_INT, &a->bound, 0, 64, NULL, "B",
       "ingp: the box is [-B, B]^3 model units, B = 1, 2, 4, ... 64; 0 = the data's (default 0)"},
      {"--background", 0, SF_ARG_CHOICE, &a->background, 0, 0, "auto|random|white|black", "KIND",
       "behind transparent pixels and rays that leave the box; auto: random, but white for tensorf on pictures with "
       "alpha (default auto)"}};
  return sf_cli_add(o, list, COUNT(list));
}

static sf_option *files(train_arguments *a, sf_option *o)
{
  const sf_option list[] = {
      SF_GROUP("Evaluation and files"),
      {"--eval-views", 0, SF_ARG_INT, &a->eval_views, 0, 1e6, NULL, "N",
       "test views rendered at the end, 0 = all (default 0)"},
      {"--psnr-prefixes", 0, SF_ARG_INT, &a->prefix_views, 0, 1e6, NULL, "N",
       "PSNR at every prefix 1..T over N test views, 0 = off (default 0)"},
      {"--checkpoint-minutes", 0, SF_ARG_DOUBLE, &a->checkpoint_minutes, 0, 1e5, NULL, "M",
       "time between checkpoints (default 2)"},
      {"--log", 0, SF_ARG_PLACE, &a->log, 0, 0, NULL, "FILE",
       "JSON lines, one per 16 iterations (default OUTPUT.jsonl)"},
      {"--summary", 0, SF_ARG_OUTPUT, &a->summary, 0, 0, NULL, "FILE", "write the closing summary there as JSON, too"}};
  return sf_cli_add(o, list, COUNT(list));
}

static sf_option *tuning(train_arguments *a, sf_option *o)
{
  sf_train_options *t = &a->train;
  const sf_option list[] = {
      SF_GROUP("Tuning"),
      {"--stage1", 0, SF_ARG_INT, &t->stage1, 0, 1e8, NULL, "N", "iterations of stage I\t#"},
      {"--stage2", 0, SF_ARG_INT, &t->stage2, 0, 1e8, NULL, "N", "iterations of stage II\t#"},
      {"--samples", 0, SF_ARG_INT, &t->samples, 256, 1 << 22, NULL, "N", "samples per iteration, about\t#"},
      {"--rays", 0, SF_ARG_INT, &t->rays, 64, 1 << 15, NULL, "N", "rays per iteration at most\t-\t#"},
      {"--lr-grid", 0, SF_ARG_DOUBLE, &t->lr_grid, 1e-8, 10, NULL, "R", "Adam's rate for the field\t#"},
      {"--lr-net", 0, SF_ARG_DOUBLE, &t->lr_net, 1e-8, 10, NULL, "R", "Adam's rate for nets and leaks\t#"},
      {"--theta", 0, SF_ARG_DOUBLE, &a->theta, 1e-3, 1e3, NULL, "V", "firing threshold\t#"},
      {"--near-camera", 0, SF_ARG_DOUBLE, &t->near_camera, 0, 100, NULL, "D",
       "what is nearer to a camera than D times the cameras' mean distance from the centre learns slower, the "
       "nearer the slower, so that no clouds settle there; 0: all learn alike; not in NDC\t#"},
      {"--distortion", 0, SF_ARG_DOUBLE, &t->distortion, 0, 100, NULL, "L",
       "weight of Mip-NeRF 360's distortion loss, which draws together what a ray sees; 0: none\t#"},
      {"--search-rate", 0, SF_ARG_DOUBLE, &t->search_rate, 0.01, 100, NULL, "R",
       "how fast the averages of the search forget; what it finds should not hang on it\t#"}};
  return sf_cli_add(o, list, COUNT(list));
}

static sf_option *sizes(train_arguments *a, sf_option *o)
{
  sf_config *c = &a->train.config;
  const sf_option list[] = {
      SF_GROUP("Sizes"),
      {"--hidden", 0, SF_ARG_INT, &c->hidden, 16, SF_LANES, NULL, "N", "neurons of a spiking layer, multiple of 16\t#"},
      {"--occ-res", 0, SF_ARG_INT, &a->occ_res, 8, 256, NULL, "N",
       "occupancy cells per axis, power of two; 128 where the bound is above 1\t256\t128"},
      {"--levels", 0, SF_ARG_INT, &c->levels, 1, 16, NULL, "L", "levels of the hash grid\t#\t-"},
      {"--log2-hash", 0, SF_ARG_INT, &c->log2_hash, 4, 24, NULL, "N", "log2 of a level's entries\t#\t-"},
      {"--base-res", 0, SF_ARG_INT, &c->base_res, 2, 4096, NULL, "N", "resolution of the coarsest level\t#\t-"},
      {"--finest-res", 0, SF_ARG_INT, &a->finest_res, 2, 32768, NULL, "N",
       "resolution of the finest level; else a pixel of the pictures, at most 2048 x bound and 32768\tpixel\t-"},
      {"--lattice", 0, SF_ARG_INT, &a->lattice, 16, 1024, NULL, "N",
       "the shortest step is the diagonal of a box of bound 1 divided by this, at the finest; else a pixel of the "
       "pictures, at most 1024, and 1024 where steps grow\tpixel\t-"},
      {"--dt-gamma", 0, SF_ARG_DOUBLE, &a->gamma, -1, 0.125, NULL, "G",
       "steps grow to distance * G, 0 = not at all; -1: 1/128 where the bound is above 1, else 0\t#\t-"},
      {"--stop", 0, SF_ARG_DOUBLE, &c->stop, SF_STOP_MIN, SF_STOP_MAX, NULL, "X",
       "a ray ends where less than this share of its light is left; 1e-4 is torch-ngp's\t#"},
      {"--voxels", 0, SF_ARG_INT, &a->train.voxels, 16, 1024, NULL, "N",
       "the finest grid has N^3 voxels; else half the pictures' width, at most 300; NDC: 0.63 of it, at most 640\t-"
       "\tpixels"}};
  return sf_cli_add(o, list, COUNT(list));
}

static sf_option *ablations(train_arguments *a, sf_option *o)
{
  sf_train_options *t = &a->train;
  const sf_option list[] = {
      SF_GROUP("Ablations, which show what each part of the method is worth"),
      {"--net", 0, SF_ARG_CHOICE, &t->config.net, 0, 0, "snn|ann", "KIND",
       "spiking nets or their ReLU twin (default snn)"},
      {"--input-mode", 0, SF_ARG_CHOICE, &a->input_mode, 0, 0, "auto|hybrid|decay|no-decay|radix", "MODE",
       "charging of the neurons; radix: a spike is worth half of one of the step before; auto: radix, but the "
       "paper's hybrid beside --objective paper and --steps-along-ray (default auto)"},
      {"--objective", 0, SF_ARG_CHOICE, &t->objective, 0, 0, "prefixes|paper", "KIND",
       "what is trained while t* is searched: the mean over all numbers of steps, or the paper's M_smooth through all "
       "T steps (default prefixes)"},
      {"--fixed-steps", 0, SF_ARG_INT, &t->fixed_steps, 0, SF_T_MAX, NULL, "N",
       "stage II trains the prefix of N steps alone, t* = N, without L_budg; 0 = t* is learned (default 0)"},
      {"--steps-along-ray", 0, SF_ARG_FLAG, &a->along, 0, 0, NULL, NULL,
       "the samples of a ray are the time steps, one each, and membranes pass from one to the next; float alone"},
      {"--no-stage1", 0, SF_ARG_FLAG, &t->no_stage1, 0, 0, NULL, NULL, "all iterations in stage II"},
      {"--no-extra", 0, SF_ARG_FLAG, &t->no_extra, 0, 0, NULL, NULL, "without L_extra"},
      {"--no-penalty", 0, SF_ARG_FLAG, &t->no_penalty, 0, 0, NULL, NULL, "without L_penalty"},
      {"--no-budget", 0, SF_ARG_FLAG, &a->no_budget, 0, 0, NULL, NULL, "without both (L_budg)"},
      {"--no-distill", 0, SF_ARG_FLAG, &t->no_distill, 0, 0, NULL, NULL, "without L_distill"},
      {"--no-scaling", 0, SF_ARG_FLAG, &t->no_scaling, 0, 0, NULL, NULL, "without max time-step scaling"}};
  return sf_cli_add(o, list, COUNT(list));
}

static void fill(train_arguments *a, sf_option *o)
{
  sf_option *end = first_run(a, o);
  end = files(a, data_and_box(a, energy(a, end)));
  end = ablations(a, sizes(a, tuning(a, end)));
  *end = (sf_option){0};
}

static const sf_option *const *columns(void)
{
  static train_arguments of[SF_FIELDS];
  static sf_option list[SF_FIELDS][TRAIN_OPTIONS_MAX];
  static const sf_option *column[SF_FIELDS];
  const sf_dataset none = {.layout = SF_LAYOUT_BLENDER, .scale = 1, .bound = 1};
  for (int i = 0; i < SF_FIELDS; i++) {
    train_option_defaults(&of[i], i == SF_TENSORF ? &none : NULL);
    fill(&of[i], list[i]);
    column[i] = list[i];
  }
  return column;
}

sf_cli train_cli(train_arguments *a, sf_option *o)
{
  fill(a, o);
  return (sf_cli){.program = "sf_train",
                  .usage = "sf_train DATA [-o model.safetensors] [options]",
                  .summary = "Learns a spiking radiance field and, with it, how many time steps the scene\n"
                             "needs (PATA). DATA is a folder of posed pictures in the Blender, LLFF, COLMAP\n"
                             "or instant-ngp layout; sf_data says what is understood of it.",
                  .examples = "  sf_train scene -o model.safetensors --minutes 2\n"
                              "  sf_train lego -o lego.safetensors --minutes 10 --beta 1e-6\n"
                              "  sf_train lego -o lego.safetensors --minutes 10 --target-loss 0.1\n"
                              "  sf_train lego -o lego.safetensors --minutes 10 --target-saving 50\n"
                              "  sf_train lego -o lego.safetensors --resume\n"
                              "  sf_train lego -o twin.safetensors --net ann --minutes 10\n"
                              "  sf_train lego -o vm.safetensors --backbone tensorf --minutes 30\n"
                              "  sf_train lego -o four.safetensors --fine-tune lego.safetensors --weight-bits 4\n",
                  .options = o,
                  .min_positional = 1,
                  .max_positional = 1,
                  .columns = "\tingp\ttensorf",
                  .defaults = columns()};
}
