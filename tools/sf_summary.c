/* sf_summary: the reports of one run of the chain in one table and one summary.json. */
#include "cli/cli.h"
#include "base/json.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* null, the quality of what cannot be compared (SSIM of tiny views, PSNR of equal images), is NaN. */
static sf_status number(const char *dir, const char *file, const char *key, double *value)
{
  char path[4096];
  cJSON *json;
  snprintf(path, sizeof path, "%s/%s", dir, file);
  SF_TRY(sf_json_load(path, &json));
  const cJSON *item = sf_json_get(json, key);
  const bool none = cJSON_IsNull(item) && (!strcmp(key, "psnr") || !strcmp(key, "ssim"));
  const bool found = cJSON_IsNumber(item) || none;
  if (found) *value = none ? NAN : item->valuedouble;
  cJSON_Delete(json);
  return found ? sf_ok() : sf_fail(SF_E_FORMAT, "%s: no number '%s'", path, key);
}

typedef struct field {
  const char *name, *file, *key;
  double value;
} field;

enum { FLOAT, FIXED, SSIM, T, T_R, SAMPLES, DIFFERENCES, SNN, ANN, SAVING, HELD_OUT, SECONDS, FIELDS };

typedef struct figure {
  char text[32];
} figure;

static figure quality(int digits, double value)
{
  figure f = {"-"};
  if (!isnan(value)) snprintf(f.text, sizeof f.text, "%.*f", digits, value);
  return f;
}

/* Where the search for t* ended, where there was one. */
static sf_status explain_search(const char *dir)
{
  char path[4096];
  cJSON *json;
  snprintf(path, sizeof path, "%s/train.json", dir);
  SF_TRY(sf_json_load(path, &json));
  const cJSON *search = sf_json_get(json, "search");
  const double worth = sf_json_number(search, "worth"), error = sf_json_number(search, "worth_error"),
               price = sf_json_number(search, "price"), t_star = sf_json_number(json, "t_star");
  const char *state = sf_json_text(search, "state");
  if (state && !isnan(worth + price + t_star)) {
    printf("  time steps    t* = %.2f (%s): one more is worth %.1e ", t_star, state, worth);
    if (!isnan(error)) printf("+- %.0e ", error);
    printf("of squared error and costs %.1e\n", price);
  }
  cJSON_Delete(json);
  return sf_ok();
}

static sf_status explain(const field *f, const char *dir)
{
  printf("\nFrom photographs to silicon in %.0f s\n", f[SECONDS].value);
  printf("  learned       t_r = %.0f of T = %.0f time steps; held-out PSNR %s dB (float, all test views)\n",
         f[T_R].value, f[T].value, quality(2, f[HELD_OUT].value).text);
  SF_TRY(explain_search(dir));
  printf("  golden view   PSNR %s dB float, %s dB fixed point, SSIM %s\n", quality(2, f[FLOAT].value).text,
         quality(2, f[FIXED].value).text, quality(4, f[SSIM].value).text);
  printf("  RTL           %.0f samples through the Verilog accelerator, %.0f differences from the fixed-point core\n",
         f[SAMPLES].value, f[DIFFERENCES].value);
  printf("  energy        %.4f mJ spiking, %.4f mJ for its ReLU twin: %.1f %% saved (0.9 pJ per SOP, 4.6 pJ per MAC)\n",
         f[SNN].value * 1e-12, f[ANN].value * 1e-12, f[SAVING].value);
  printf("Open %s/report.html: what every operation cost, with pictures, for anybody.\n", dir);
  printf("Look at %s/preview.png; %s/golden.exr holds depth, spikes and energy per pixel; %s/audit.json every count.\n",
         dir, dir, dir);
  return sf_ok();
}

static sf_status parse_seconds(const char *text, double *seconds)
{
  char *end;
  *seconds = strtod(text, &end);
  if (end != text && !*end && *seconds >= 0 && *seconds <= 1e9) return sf_ok();
  return sf_fail(SF_E_USAGE, "SECONDS is '%.40s', expected a number of 0..1e9", text);
}

static sf_status run(const char *dir, double seconds)
{
  field f[FIELDS] = {{"psnr_float", "float.json", "psnr", 0},
                     {"psnr_fixed", "fixed.json", "psnr", 0},
                     {"ssim_fixed", "fixed.json", "ssim", 0},
                     {"T", "train.json", "T", 0},
                     {"t_r", "train.json", "t_r", 0},
                     {"cosim_samples", "cosim.json", "samples", 0},
                     {"cosim_differences", "cosim.json", "differences", 0},
                     {"energy_spiking_fj", "audit.json", "energy_spiking_fj", 0},
                     {"energy_ann_fj", "audit.json", "energy_ann_fj", 0},
                     {"energy_saving_percent", "audit.json", "energy_saving_percent", 0},
                     {"psnr_held_out", "train.json", "psnr", 0},
                     {"seconds", NULL, NULL, seconds}};
  cJSON *json = cJSON_CreateObject();
  sf_status status = json ? sf_ok() : sf_fail(SF_E_MEMORY, "%s: no memory", dir);
  for (int i = 0; i < FIELDS && !status.code; i++) {
    if (f[i].file) status = number(dir, f[i].file, f[i].key, &f[i].value);
    cJSON_AddNumberToObject(json, f[i].name, f[i].value);
  }
  char path[4096];
  snprintf(path, sizeof path, "%s/summary.json", dir);
  if (!status.code) status = sf_json_save(json, path);
  cJSON_Delete(json);
  return status.code ? status : explain(f, dir);
}

int main(int argc, char **argv)
{
  const sf_option options[] = {{0}};
  const sf_cli cli = {.program = "sf_summary",
                      .usage = "sf_summary DIR SECONDS",
                      .summary =
                          "Gathers DIR/{train,float,fixed,cosim,audit}.json into DIR/summary.json and prints it.",
                      .examples = "  sf_summary build/demo 200\n",
                      .options = options,
                      .min_positional = 2,
                      .max_positional = 2};
  const char *argument[2] = {NULL, NULL};
  sf_status status = sf_cli_parse(&cli, argc, argv, argument);
  double seconds = 0;
  if (!status.code) status = parse_seconds(argument[1], &seconds);
  if (!status.code) status = run(argument[0], seconds);
  return sf_cli_finish(&cli, status);
}
