/* The VM-factorised field, sample by sample: the oracle of the kernels in src/snn/vm_isa.h. Chen et al. 2022, in the
 * form of their code: grid_sample with align_corners, planes and lines of one mode multiplied component by component.
 */
#include "field/model.h"
#include <math.h>
#include <string.h>

const int sf_tensorf_axis[3][3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};

static sf_status check(const char *name, double value, double low, double high)
{
  if (value >= low && value <= high) return sf_ok();
  return sf_fail(SF_E_RANGE, "model config: %s = %g is outside %g..%g", name, value, low, high);
}

sf_status sf_tensorf_check(const sf_tensorf *f)
{
  for (int i = 0; i < 3; i++) {
    SF_TRY(check("box", f->box[0][i], -1e6, 1e6));
    SF_TRY(check("box", f->box[1][i], f->box[0][i] + 1e-6, 1e6));
    SF_TRY(check("resolution", f->resolution[i], 2, 4096));
    SF_TRY(check("density components", f->density[i], 4, 16));
    SF_TRY(check("appearance components", f->appearance[i], 4, SF_COMPONENTS_MAX));
    if (f->density[i] % 4 || f->appearance[i] % 4)
      return sf_fail(SF_E_RANGE, "model config: %d and %d components are not multiples of 4", f->density[i],
                     f->appearance[i]);
  }
  SF_TRY(check("features", f->features, 1, SF_APPEARANCE_MAX));
  SF_TRY(check("feature_freqs", f->feature_freqs, 0, SF_FREQS_MAX));
  SF_TRY(check("view_freqs", f->view_freqs, 0, SF_FREQS_MAX));
  SF_TRY(check("decoder inputs", sf_tensorf_inputs(f), 1, SF_DECODER_MAX - 1));
  SF_TRY(check("activation", f->activation, SF_SOFTPLUS, SF_RELU));
  SF_TRY(check("density_shift", f->shift, -100, 100));
  SF_TRY(check("distance_scale", f->distance_scale, 1e-9, 1e9));
  SF_TRY(check("step_ratio", f->step_ratio, 0.05, 8));
  SF_TRY(check("near", f->near, 0, 1e6));
  SF_TRY(check("far", f->far, f->near + 1e-6, 1e9));
  SF_TRY(check("ndc", f->ndc, 0, 1));
  return check("weight_stop", f->weight_stop, SF_WEIGHT_STOP_MIN, SF_WEIGHT_STOP_MAX);
}

void sf_tensorf_resolution(float box[2][3], double voxels, int32_t resolution[3])
{
  double volume = 1;
  for (int i = 0; i < 3; i++) volume *= box[1][i] - box[0][i];
  const double edge = cbrt(volume / voxels);
  for (int i = 0; i < 3; i++) resolution[i] = (int32_t)fmin(fmax((box[1][i] - box[0][i]) / edge + 1e-6, 2), 4096);
}

float sf_tensorf_step(const sf_tensorf *f)
{
  float edge = 0, diagonal = 0;
  for (int i = 0; i < 3; i++) {
    const float size = f->box[1][i] - f->box[0][i];
    edge += size / (float)(f->resolution[i] - 1) / 3;
    diagonal += size * size;
  }
  return fmaxf(edge * f->step_ratio, sqrtf(diagonal) / 1024);
}

/* A point between two grid points of an axis. */
typedef struct between {
  int low, high;
  float part; /* of high */
} between;

static between locate(float x, int resolution)
{
  const float at = x * (float)(resolution - 1);
  const int low = (int)fminf(fmaxf(floorf(at), 0), (float)(resolution - 2));
  return (between){low, low + 1, at - (float)low};
}

/* plane[c] * line[c] of one mode. first: the id of its plane, SF_P_DENSITY_PLANE or SF_P_APP_PLANE + mode. */
static void products(const sf_model *m, int first, int mode, const float x[3], int components, float *out)
{
  const sf_tensorf *f = &m->config.tensorf;
  const int *axis = sf_tensorf_axis[mode], width = f->resolution[axis[0]];
  const between u = locate(x[axis[0]], width), v = locate(x[axis[1]], f->resolution[axis[1]]),
                w = locate(x[axis[2]], f->resolution[axis[2]]);
  const float *plane = sf_model_param(m, first), *line = sf_model_param(m, first + 3);
  for (int c = 0; c < components; c++) {
    const float a = plane[((size_t)v.low * width + u.low) * components + c],
                b = plane[((size_t)v.low * width + u.high) * components + c],
                d = plane[((size_t)v.high * width + u.low) * components + c],
                e = plane[((size_t)v.high * width + u.high) * components + c];
    const float on_plane = (1 - v.part) * ((1 - u.part) * a + u.part * b) + v.part * ((1 - u.part) * d + u.part * e);
    const float on_line =
        (1 - w.part) * line[(size_t)w.low * components + c] + w.part * line[(size_t)w.high * components + c];
    out[c] = on_plane * on_line;
  }
}

float sf_tensorf_density_feature(const sf_model *m, const float x[3])
{
  float sum = 0, product[SF_COMPONENTS_MAX];
  for (int i = 0; i < 3; i++) {
    const int n = m->config.tensorf.density[i];
    products(m, SF_P_DENSITY_PLANE + i, i, x, n, product);
    for (int c = 0; c < n; c++) sum += product[c];
  }
  return sum;
}

float sf_tensorf_sigma(const sf_tensorf *f, float feature)
{
  const float x = feature + f->shift;
  const float active = f->activation == SF_RELU ? fmaxf(x, 0) : x > 20 ? x : log1pf(expf(x));
  return f->distance_scale * active;
}

void sf_tensorf_appearance(const sf_model *m, const float x[3], float *features)
{
  const sf_tensorf *f = &m->config.tensorf;
  const int all = sf_tensorf_products(f);
  float product[3 * SF_COMPONENTS_MAX] = {0};
  for (int i = 0, n = 0; i < 3; n += f->appearance[i++])
    products(m, SF_P_APP_PLANE + i, i, x, f->appearance[i], product + n);
  const float *basis = sf_model_param(m, SF_P_BASIS);
  for (int o = 0; o < f->features; o++) {
    features[o] = 0;
    for (int c = 0; c < all; c++) features[o] += basis[o * all + c] * product[c];
  }
}

/* sin, cos of x[n] 2^0 .. 2^(freqs-1); returns behind the last. */
static float *encode(const float *x, int n, int freqs, float *out)
{
  for (int i = 0; i < n * freqs; i++) {
    const float angle = ldexpf(x[i / freqs], i % freqs);
    out[i] = sinf(angle);
    out[n * freqs + i] = cosf(angle);
  }
  return out + 2 * n * freqs;
}

void sf_tensorf_encode(const sf_tensorf *f, const float *features, const float direction[3], float *in)
{
  memcpy(in, features, (size_t)f->features * sizeof *in);
  memcpy(in + f->features, direction, 3 * sizeof *in);
  float *rest = encode(features, f->features, f->feature_freqs, in + f->features + 3);
  encode(direction, 3, f->view_freqs, rest);
}
