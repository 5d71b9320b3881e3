/* For the tests of the quantiser: a model as training leaves it, its export, what is refused. */
#ifndef SF_TESTS_QUANT_FIXTURE_H
#define SF_TESTS_QUANT_FIXTURE_H
#include "ck_run.h"
#include "base/rng.h"
#include "quant/quant.h"

static inline float normal(uint64_t stream, uint64_t i)
{
  float sum = 0;
  for (uint64_t n = 0; n < 12; n++) sum += sf_random_float(4, stream, i * 12 + n);
  return sum - 6;
}

static inline void fill(sf_model *m, sf_param_id id, float scale)
{
  float *value = sf_model_param(m, id);
  for (size_t i = 0; i < m->param[id].size; i++) value[i] = scale * normal((uint64_t)id, i);
}

/* Currents of the size of theta, finer levels with smaller entries, as training leaves them. */
static inline sf_model make_model(int hidden, int levels, int mode)
{
  sf_config config = sf_config_default();
  sf_model m;
  config.hidden = hidden, config.levels = levels, config.mode = mode;
  config.steps = 4, config.log2_hash = 12, config.finest_res = 256, config.occ_res = 16, config.lattice = 256;
  ck_ok(sf_model_create(&m, &config));
  fill(&m, SF_P_GRID, 1);
  for (int l = 0; l < levels; l++)
    for (size_t i = 2 * m.level[l].offset; i < 2 * (m.level[l].offset + m.level[l].entries); i++)
      sf_model_param(&m, SF_P_GRID)[i] *= 0.8f / (float)(1 + l);
  fill(&m, SF_P_D1, 1.2f);
  fill(&m, SF_P_D2, 0.5f);
  fill(&m, SF_P_C1, 0.5f);
  fill(&m, SF_P_C2, 0.3f);
  fill(&m, SF_P_C3, 0.3f);
  fill(&m, SF_P_LEAK, 0.5f);
  m.t_r = 3;
  m.t_star = 3.2f;
  for (size_t i = 0; i < 512; i++) m.occupancy[i] = (uint8_t)sf_random_u64(1, 2, i);
  return m;
}

static const sf_quant_options plain = {.background = {1, 1, 1}, .seed = 1};

static inline void quantise(const sf_model *m, fx_scene *scene, sf_quant_report *report)
{
  ck_ok(sf_quantise_report(scene, m, "model", &plain, report));
}

static inline void assert_refused(const sf_model *m, const sf_quant_options *options, sf_code code, const char *place)
{
  fx_scene scene;
  const sf_status status = sf_quantise(&scene, m, "dir/model.safetensors", options);
  ck_assert_msg(status.code == code, "code %d: '%s' where '%s' should be refused", status.code, status.message, place);
  ck_assert_msg(strstr(status.message, "dir/model.safetensors") && strstr(status.message, place),
                "'%s' does not name '%s'", status.message, place);
  ck_assert_ptr_null(scene.owner);
}

#endif
