/* The converted twin: in the limit of many steps the twin itself; counts that follow from its spikes. */
#include "ck_run.h"
#include "folder_fixture.h"
#include "convert/internal.h"
#include "image/image.h"
#include "tensorf_fixture.h"
#include <math.h>

enum { HIDDEN = 32 };
static sf_model twin;
static sf_dataset data;
static sf_converted net;

static int told;
static void count_told(void *user, int done)
{
  ck_assert_ptr_eq(user, &told);
  told = done > told ? done : told;
}
static const sf_conversion_rays some = {60, 5, count_told, &told};

static void set_up(void)
{
  make_folder();
  const sf_procedural_options o = {.width = 24, .height = 24, .train_views = 3, .test_views = 1, .seed = 1};
  ck_ok(sf_procedural_write("simple", in("scene"), &o, NULL, NULL));
  ck_ok(sf_dataset_load(&data, in("scene"), "train", &(sf_dataset_options){.downscale = 1}));
  twin = test_model(SF_NET_ANN, SF_HYBRID, HIDDEN, 1, 0.4f);
  ck_assert_ptr_nonnull(twin.value);
  ck_ok(sf_convert(&net, &twin, &data, 40, 100, 1));
}

static void tear_down(void)
{
  sf_converted_free(&net);
  sf_model_free(&twin);
  sf_dataset_free(&data);
  remove_folder();
}

static void inputs(int i, float f[32], float sh[16])
{
  const float d[3] = {test_random(900 + 3 * i), test_random(901 + 3 * i), test_random(902 + 3 * i)};
  const float length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  float x[3], unit[3];
  for (int a = 0; a < 3; a++) x[a] = 0.5f + 0.45f * test_random(500 + 3 * i + a), unit[a] = d[a] / length;
  sf_grid_features(&twin, x, f);
  sf_sh4(unit, sh);
}

/* With thresholds above every activation a rate is off by at most a spike in T: the outputs come closer with T. */
TEST(limit)
{
  static const int steps[] = {4, 64, 1024};
  double worst[3] = {0};
  for (int l = 0; l < SF_CONVERTED_LAYERS; l++) net.threshold[l] *= 2; /* these inputs are not the rays' */
  for (int i = 0; i < 20; i++) {
    float f[32], sh[16], sigma, colour[3];
    sf_converted_output out[3];
    inputs(i, f, sh);
    sf_net_sample(&twin, f, sh, 1, &sigma, colour, NULL);
    sf_converted_sample(&net, f, sh, 3, steps, out);
    for (int p = 0; p < 3; p++) {
      worst[p] = fmax(worst[p], fabs(log(out[p].sigma / sigma)));
      for (int c = 0; c < 3; c++) worst[p] = fmax(worst[p], fabs(out[p].colour[c] - colour[c]));
    }
  }
  ck_assert_msg(worst[1] < 0.5 * worst[0] && worst[2] < 0.2 * worst[1], "off by %g, %g, %g", worst[0], worst[1],
                worst[2]);
  ck_assert_msg(worst[2] < 0.01, "off by %g after 1024 steps", worst[2]);
}

/* One neuron of each layer fires at every step, the others never: its fan-out is what is added. */
TEST(counts)
{
  static const int steps[] = {1, 5};
  float f[32] = {1}, sh[16] = {0};
  sf_converted_output out[2];
  for (size_t i = 0; i < twin.size; i++) twin.value[i] = 0;
  float *d1 = sf_model_param(&twin, SF_P_D1), *d2 = sf_model_param(&twin, SF_P_D2),
        *c1 = sf_model_param(&twin, SF_P_C1), *c2 = sf_model_param(&twin, SF_P_C2),
        *c3 = sf_model_param(&twin, SF_P_C3);
  d1[3 * 8] = 2; /* [hidden][8 features] */
  d2[0 * HIDDEN + 3] = 0.25f, d2[1 * HIDDEN + 3] = 1;
  c1[5 * 31 + 16] = 1, c2[7 * HIDDEN + 5] = 1, c3[1 * HIDDEN + 7] = 0.5f;
  sf_converted_free(&net);
  ck_ok(sf_convert(&net, &twin, &data, 4, 100, 1)); /* nothing fires there: thresholds of 1 */
  net.threshold[0] = 2, net.threshold[1] = 2, net.threshold[2] = 2;
  sf_converted_sample(&net, f, sh, 2, steps, out);
  ck_assert_uint_eq(out[0].sops, 16 + HIDDEN + 3);
  ck_assert_uint_eq(out[1].sops, 5 * (16 + HIDDEN + 3));
  ck_assert_double_eq_tol(out[1].sigma, exp(0.5), 1e-6); /* 2 * 0.25 */
  ck_assert_double_eq_tol(out[1].colour[1], 1 / (1 + exp(-1)), 1e-6);
  ck_assert_double_eq_tol(out[1].colour[0], 0.5, 1e-6);
  ck_assert_uint_eq(sf_converted_macs(&twin, 0), HIDDEN * (8 + 16 + 31 + HIDDEN + 3));
  ck_assert_uint_eq(sf_converted_macs(&twin, 5), HIDDEN * (8 + 16 + 5 * 15));
}

/* PSNR of the same rays through the renderer's kernels. */
static double rendered(const sf_model *model, int count, uint64_t seed)
{
  static float origin[3 * 64], direction[3 * 64], rgb[3 * 64], truth[3 * 64];
  const float white[3] = {1, 1, 1};
  for (int i = 0; i < count; i++) {
    convert_ray ray;
    ck_ok(convert_pick(&data, seed, (uint64_t)i, &ray));
    memcpy(origin + 3 * i, ray.origin, sizeof ray.origin);
    memcpy(direction + 3 * i, ray.direction, sizeof ray.direction);
    memcpy(truth + 3 * i, ray.truth, sizeof ray.truth);
  }
  ck_ok(sf_render_rays(model, origin, direction, (size_t)count, 1, white, rgb, NULL, NULL, NULL));
  for (int i = 0; i < 3 * count; i++) rgb[i] = fminf(fmaxf(rgb[i], 0), 1);
  return sf_psnr(rgb, truth, 3 * (size_t)count);
}

/* The twin's rays are those of the renderer, and its energy every synapse a MAC. */
TEST(rays)
{
  static const int steps[] = {8, 512};
  sf_conversion own, at[2], again[2];
  ck_ok(sf_convert_measure(&net, &data, &some, 2, steps, &own, at));
  ck_assert(told > 0 && told <= 60);
  ck_assert_uint_gt(own.samples, 60);
  ck_assert_double_eq_tol(own.psnr, rendered(&twin, 60, 5), 0.01);
  ck_assert_uint_eq(own.fj, own.samples * sf_converted_macs(&twin, 0) * 4600);
  ck_assert_uint_eq(at[0].fj, at[0].macs * 4600 + at[0].sops * 900);
  ck_assert_uint_gt(at[1].sops, 10 * at[0].sops);
  ck_assert_msg(fabs(at[1].psnr - own.psnr) < 0.1, "%g dB after 512 steps, the twin has %g", at[1].psnr, own.psnr);
  ck_ok(sf_convert_measure(&net, &data, &some, 2, steps, &own, again));
  ck_assert(again[0].psnr == at[0].psnr && again[0].fj == at[0].fj);
}

/* A decoder: a limit, counts and rays as above. Its densities are the field's, so the steps change no ray's samples. */
TEST(decoder)
{
  static const int steps[] = {1, 512, 1024};
  float in[SF_DECODER_MAX], colour[3], sigma = 0;
  sf_converted decoder;
  sf_converted_output out[3];
  sf_conversion own, at[3];
  sf_model planes = test_tensorf(SF_NET_ANN, 0, HIDDEN, 1);
  planes.config.tensorf.weight_stop = 0.0003;
  for (int i = 0; i < HIDDEN; i++)
    sf_model_param(&planes, SF_P_C1_BIAS)[i] = 0.2f * test_random(70000 + i),
                            sf_model_param(&planes, SF_P_C2_BIAS)[i] = 0.1f * test_random(71000 + i);
  for (int c = 0; c < 3; c++) sf_model_param(&planes, SF_P_C3_BIAS)[c] = 0.5f * test_random(72000 + c);
  ck_ok(sf_convert(&decoder, &planes, &data, 40, 100, 1));
  ck_assert_int_eq(decoder.first, 1);
  ck_assert(!(decoder.threshold[0] > 0));

  decoder.threshold[1] *= 3, decoder.threshold[2] *= 3; /* these inputs are not the rays' */
  double worst[3] = {0};
  for (int i = 0; i < 20; i++) {
    for (int j = 0; j < 150; j++) in[j] = test_random(80000 + 200 * i + j);
    sf_net_sample(&planes, in, NULL, 1, &sigma, colour, NULL);
    sf_converted_sample(&decoder, in, NULL, 3, steps, out);
    for (int p = 0; p < 3; p++)
      for (int c = 0; c < 3; c++) worst[p] = fmax(worst[p], fabs(out[p].colour[c] - colour[c]));
  }
  ck_assert_msg(worst[2] < 0.01 && worst[2] < worst[0] / 10, "off by %g after 1024 steps, by %g after 1", worst[2],
                worst[0]);
  decoder.threshold[1] /= 3, decoder.threshold[2] /= 3;

  ck_ok(sf_convert_measure(&decoder, &data, &some, 3, steps, &own, at));
  ck_assert_uint_gt(own.samples, 60);
  ck_assert_double_eq_tol(own.psnr, rendered(&planes, 60, 5), 0.01);
  ck_assert_uint_eq(own.macs, own.samples * HIDDEN * (150 + HIDDEN + 3));
  for (int p = 0; p < 3; p++) ck_assert_uint_eq(at[p].samples, own.samples);
  ck_assert_uint_eq(at[0].macs, own.samples * HIDDEN * 150);
  ck_assert_msg(fabs(at[2].psnr - own.psnr) < 0.1, "%g dB after 1024 steps, the twin has %g", at[2].psnr, own.psnr);

  /* Of C1 neuron 5 alone fires, at every step, and of C2 neuron 7; colour 1 is half of its threshold. */
  for (int id = SF_P_C1; id <= SF_P_C3; id++)
    memset(sf_model_param(&planes, id), 0, planes.param[id].size * sizeof(float));
  for (int i = 0; i < HIDDEN; i++)
    sf_model_param(&planes, SF_P_C1_BIAS)[i] = sf_model_param(&planes, SF_P_C2_BIAS)[i] = 0;
  for (int c = 0; c < 3; c++) sf_model_param(&planes, SF_P_C3_BIAS)[c] = 0;
  sf_model_param(&planes, SF_P_C1_BIAS)[5] = 2, sf_model_param(&planes, SF_P_C2_BIAS)[7] = 2;
  sf_model_param(&planes, SF_P_C3)[1 * HIDDEN + 7] = 0.5f, sf_model_param(&planes, SF_P_C3_BIAS)[2] = 0.25f;
  sf_converted_free(&decoder);
  ck_ok(sf_convert(&decoder, &planes, &data, 4, 100, 1));
  decoder.threshold[1] = decoder.threshold[2] = 2;
  sf_converted_sample(&decoder, in, NULL, 3, steps, out);
  ck_assert_uint_eq(out[0].sops, HIDDEN + 3);
  ck_assert_uint_eq(out[1].sops, 512 * (HIDDEN + 3));
  ck_assert_double_eq_tol(out[1].colour[0], 0.5, 1e-6);
  ck_assert_double_eq_tol(out[1].colour[1], 1 / (1 + exp(-1)), 1e-5);
  ck_assert_double_eq_tol(out[1].colour[2], 1 / (1 + exp(-0.25)), 1e-5);
  sf_converted_free(&decoder);
  sf_model_free(&planes);
}

TEST(refusals)
{
  sf_converted other;
  sf_model spiking = test_model(SF_NET_SNN, SF_HYBRID, HIDDEN, 4, 0.4f);
  ck_bad(sf_convert(&other, &spiking, &data, 4, 100, 1), SF_E_USAGE, "no ReLU twin", "--net ann");
  sf_model_free(&spiking);
  for (int v = 0; v < data.count; v++) free(data.view[v].image.rgba), data.view[v].image.rgba = NULL;
  ck_bad(sf_convert(&other, &twin, &data, 4, 100, 1), SF_E_FORMAT, "no view with a picture", "scene");
}

ck_options ck_program = {.set_up = set_up, .tear_down = tear_down};
