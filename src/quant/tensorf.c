/* TensoRF's field and decoder in the quantiser. */
#include "base/rng.h"
#include "src/quant/internal.h"
#include <math.h>
#include <string.h>

enum { TRIES = 2048, BLOCK = 32, PROBES = 64 };
enum { STREAM_PLACE = 111, STREAM_DIRECTION };
enum { ENCODING_TRIED = 1 - FX_DIR_FRAC_MAX, ENCODING_COARSEST = -5 };
static const float SEEN = 0.01f; /* opacity of one sample */

static int features(const sf_model *model)
{
  return model->config.tensorf.features;
}

static sf_status set_sizes(fx_scene *scene, const sf_model *model, const char *name, const sf_quant_widths *widths)
{
  const sf_tensorf *from = &model->config.tensorf;
  fx_tensorf *to = &scene->tensorf;
  if (widths->feature_bits != SF_INPUT_BITS)
    return sf_fail(SF_E_UNSUPPORTED, "%s: %d bits asked for features, those of a TensoRF scene have %d", name,
                   widths->feature_bits, SF_INPUT_BITS);
  scene->backbone = FX_TENSORF;
  for (int i = 0; i < 3; i++) {
    to->res[i] = from->resolution[i];
    to->density.components[i] = from->density[i], to->appearance.components[i] = from->appearance[i];
  }
  to->features = from->features;
  to->feature_freqs = from->feature_freqs, to->view_freqs = from->view_freqs;
  return sf_ok();
}

static double longest_edge(const sf_tensorf *field)
{
  double longest = 0;
  for (int axis = 0; axis < 3; axis++) longest = fmax(longest, (double)field->box[1][axis] - field->box[0][axis]);
  return longest;
}

static void set_scalars(fx_scene *scene, const sf_model *model)
{
  const sf_tensorf *from = &model->config.tensorf;
  fx_tensorf *to = &scene->tensorf;
  const double edge = longest_edge(from);
  scene->units.to_box_scale = 1 / edge;
  for (int axis = 0; axis < 3; axis++) {
    scene->units.to_box_offset[axis] = -from->box[0][axis] / edge;
    scene->units.stretch[axis] = edge / ((double)from->box[1][axis] - from->box[0][axis]);
  }
  scene->units.near = from->near, scene->units.far = from->far;
  scene->step_q24 = (int32_t)nearbyint(ldexp(sf_tensorf_step(from) / edge, SF_DELTA_FRAC));
  to->activation = from->activation == SF_RELU ? FX_RELU : FX_SOFTPLUS;
  to->weight_stop = (int32_t)floor(ldexp(from->weight_stop, SF_TRANS_FRAC));
}

/* ---- calibration: points that a ray sees ---- */

static bool occupied(const sf_model *model, const uint32_t pos[3])
{
  const uint64_t res = (uint64_t)model->config.occ_res;
  uint64_t cell = 0;
  for (int axis = 2; axis >= 0; axis--) cell = cell * res + (pos[axis] * res >> SF_POS_FRAC);
  return model->occupancy[cell >> 3] >> (cell & 7) & 1;
}

static float opacity(const sf_model *model, const uint32_t pos[3])
{
  const sf_tensorf *field = &model->config.tensorf;
  float x[3];
  sf_calibration_position(pos, x);
  return 1 - expf(-sf_tensorf_sigma(field, sf_tensorf_density_feature(model, x)) * sf_tensorf_step(field));
}

/* A point that is seen, where `look` says that there are some; failing that an occupied one, failing that any. Its
 * rank: 2, 1, 0. */
static int draw_position(const sf_model *model, uint64_t seed, int sample, bool look, uint32_t *pos)
{
  const int best = look ? 2 : 1;
  int rank = -1;
  for (int i = 0; i < TRIES && rank < best; i++) {
    uint32_t at[3];
    for (int axis = 0; axis < 3; axis++)
      at[axis] = (uint32_t)sf_random_below(
          seed, STREAM_PLACE, ((uint64_t)sample * TRIES + (uint64_t)i) * 3 + (uint64_t)axis, 1 << SF_POS_FRAC);
    const int now = !occupied(model, at) ? 0 : !look || opacity(model, at) < SEEN ? 1 : 2;
    if (now <= rank) continue;
    rank = now;
    memcpy(pos, at, sizeof at);
  }
  return rank;
}

/* What the first samples do not find in any of their tries, as in a field that has hardly been trained, is not looked
 * for by the others. */
static sf_status draw(sf_calibration *c, const sf_model *model, uint64_t seed)
{
  const int probes = c->samples < PROBES ? c->samples : PROBES;
  int best = 0;
#pragma omp parallel for schedule(static, 1) reduction(max : best)
  for (int sample = 0; sample < probes; sample++) {
    const int rank = draw_position(model, seed, sample, true, c->pos + (size_t)sample * 3);
    best = rank > best ? rank : best;
  }
#pragma omp parallel for schedule(static, BLOCK)
  for (int sample = probes; sample < c->samples; sample++)
    draw_position(model, seed, sample, best == 2, c->pos + (size_t)sample * 3);
  return sf_ok();
}

static void sample(const sf_model *model, const float x[3], const float direction[3], int steps, float *f,
                   float *constant, sf_net_trace *trace)
{
  float colour[SF_T_MAX * 3];
  sf_tensorf_appearance(model, x, f);
  sf_tensorf_encode(&model->config.tensorf, f, direction, constant);
  sf_net_sample(model, constant, NULL, steps, NULL, colour, trace);
}

/* ---- how the decoder's inputs are rounded ---- */

static void set_inputs(fx_scene *scene, double feature, double encoding)
{
  const double coarser = feature / scene->units.feature_scale[0]; /* a power of two */
  scene->tensorf.feature_in.shift += ilogb(coarser);
  scene->units.feature_scale[0] = feature;
  scene->tensorf.encoding_frac = -ilogb(encoding);
}

const sf_field_quantiser sf_tensorf_quantiser = {.direction_stream = STREAM_DIRECTION,
                                                 .tried = ENCODING_TRIED,
                                                 .coarsest = ENCODING_COARSEST,
                                                 .features = features,
                                                 .set_sizes = set_sizes,
                                                 .set_scalars = set_scalars,
                                                 .draw = draw,
                                                 .sample = sample,
                                                 .quantise = sf_quantise_factors,
                                                 .set_inputs = set_inputs};
