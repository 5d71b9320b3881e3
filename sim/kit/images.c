/* The images that the bench reads with $readmemh, one word per line, the most significant digit first. */
#include "sim/kit/kit.h"
#include "sim/ray/request.h"
#include "sim/sim.h"
#include "energy/energy.h"
#include <inttypes.h>

enum { WINDOW = 512, GLOBAL_LAYER = 7, GLOBAL_SAMPLES = 0, GLOBAL_RAYS = 1 };

/* ---- programming ---- */

/* Records what the driver writes. Read, it is a block with both fields that returns the sizes of its layers, and 0
 * elsewhere: no error, nothing busy. */
typedef struct recorder {
  FILE *file;
  int writes;
  uint32_t d1_n_in, c1_n_in, d2_n_out;
} recorder;

static uint32_t record_read(void *context, uint32_t offset)
{
  const recorder *r = context;
  return offset == SF_CSR_FIELD_KINDS ? SF_CSR_FIELD_KINDS_RESET
         : offset == SF_CSR_D1_N_IN   ? r->d1_n_in
         : offset == SF_CSR_C1_N_IN   ? r->c1_n_in
         : offset == SF_CSR_D2_N_OUT  ? r->d2_n_out
                                      : 0;
}

static void record_write(void *context, uint32_t offset, uint32_t value)
{
  recorder *r = context;
  fprintf(r->file, "%04" PRIx32 "%08" PRIx32 "\n", offset, value);
  r->writes++;
  if (offset == SF_CSR_D1_N_IN) r->d1_n_in = value;
  if (offset == SF_CSR_C1_N_IN) r->c1_n_in = value;
  if (offset == SF_CSR_D2_N_OUT) r->d2_n_out = value;
}

static sf_status write_program(sf_kit_output *output, const fx_net *net, int *writes)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, SF_KIT_FIRST));
  recorder r = {.file = file.writer.file};
  const sf_bus bus = {.read = record_read, .write = record_write, .context = &r};
  const sf_net_blob blob = sf_dut_blob(net);
  sf_driver_load(&bus, &blob);
  record_write(&r, SF_CSR_IRQ_ENABLE, SF_CSR_IRQ_ENABLE_ERROR);
  sf_driver_clear(&bus);
  *writes = r.writes;
  return sf_kit_end(output, &file);
}

sf_status sf_kit_program_rays(sf_kit_output *output, const fx_scene *scene, uint32_t base, int *writes)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "ray_program.hex"));
  recorder r = {.file = file.writer.file};
  const sf_bus bus = {.read = record_read, .write = record_write, .context = &r};
  const sf_net_blob net = sf_dut_blob(&scene->net);
  const sf_ray_blob rays = sf_ray_blob_of(scene, base);
  const sf_planes_blob planes = sf_ray_planes_of(&scene->tensorf);
  sf_driver_load(&bus, &net);
  const sf_driver_code code = sf_ray_driver_load(&bus, &rays, scene->backbone == FX_TENSORF ? &planes : NULL);
  record_write(&r, SF_CSR_IRQ_ENABLE, SF_CSR_IRQ_ENABLE_ERROR);
  record_write(&r, SF_CSR_RAY_IRQ_ENABLE, ~0u);
  sf_driver_clear(&bus);
  sf_ray_driver_clear(&bus);
  *writes = r.writes;
  SF_TRY(sf_kit_end(output, &file));
  return code == SF_DRIVER_OK ? sf_ok() : sf_fail(SF_E_FORMAT, "vectors: the scene's field does not fit sf_ray_top");
}

static sf_status write_weights(sf_kit_output *output, const fx_net *net)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "weights.hex"));
  for (int l = 0; l < SF_LAYERS; l++)
    for (int row = 0; row < fx_layer_rows(&net->layer[l]); row++) {
      for (int lane = SF_LANES - 1; lane >= 0; lane--)
        fprintf(file.writer.file, "%02x", (unsigned)(uint8_t)net->layer[l].w[row * SF_LANES + lane]);
      fputc('\n', file.writer.file);
    }
  return sf_kit_end(output, &file);
}

/* ---- streams ---- */

static sf_status write_stimulus(sf_kit_output *output, const sf_kit_draw *d, int *beats)
{
  sf_kit_writer file;
  uint64_t word[SF_PACKET_MAX];
  SF_TRY(sf_kit_begin(output, &file, "stimulus.hex"));
  *beats = 0;
  for (int i = 0; i < d->samples; i++) {
    const sf_kit_sample *s = &d->sample[i];
    const sf_dut_sample sample = {.ray = &d->ray[s->ray].ray, .first = s->first, .f = s->f};
    const int n = sf_dut_packet(&d->scene->net, &sample, word);
    for (int b = 0; b < n; b++) {
      const unsigned flags =
          (b == 0 && (s->first || fx_net_constants_per_sample(&d->scene->net)) ? 2u : 0u) | (b == n - 1 ? 1u : 0u);
      fprintf(file.writer.file, "%x%016" PRIx64 "\n", flags, word[b]);
    }
    *beats += n;
  }
  return sf_kit_end(output, &file);
}

static sf_status write_outputs(sf_kit_output *output, const sf_kit_draw *d)
{
  sf_kit_writer file;
  SF_TRY(sf_kit_begin(output, &file, "expected_outputs.hex"));
  for (int i = 0; i < d->samples; i++) {
    const fx_out *o = &d->sample[i].out;
    fprintf(file.writer.file, "%08" PRIx32 "%08" PRIx32 "\n", o->colour[0], o->sigma);
    fprintf(file.writer.file, "%08" PRIx32 "%08" PRIx32 "\n", o->colour[2], o->colour[1]);
  }
  return sf_kit_end(output, &file);
}

/* ---- taps ---- */

static void put_bits(FILE *file, const uint64_t bits[SF_SPIKE_WORDS])
{
  for (int word = SF_SPIKE_WORDS - 1; word >= 0; word--) fprintf(file, "%016" PRIx64, bits[word]);
  fputc('\n', file);
}

static void put_spikes(FILE *file, const sf_kit_sample *s, int layer, int step)
{
  put_bits(file, s->trace.spikes[layer][step]);
}

/* After reset, as the tap shows them; lanes that the layer does not have: 0. */
static void put_membranes(FILE *file, const fx_net *net, const sf_kit_sample *s, int layer, int step)
{
  const fx_layer *l = &net->layer[layer];
  for (int n = SF_LANES - 1; n >= 0; n--) {
    const int32_t v = n < l->n_out ? fx_membrane_left(net, &s->trace, layer, step, n) : 0;
    fprintf(file, "%06" PRIx32, (uint32_t)v & ((1u << SF_MEMBRANE_BITS) - 1));
  }
  fputc('\n', file);
}

/* Presynaptic neurons that were added up: C2 those of the step, D2 and C3 those that fired at any step. */
static void put_rows(FILE *file, const fx_net *net, const sf_kit_sample *s, int layer, int step)
{
  const int presynaptic = fx_layer_table[layer].spikes_of;
  const int from = fx_layer_fires(layer) ? step : 0, to = fx_layer_fires(layer) ? step + 1 : net->steps;
  uint64_t rows[SF_SPIKE_WORDS] = {0};
  for (int t = from; t < to; t++)
    for (int word = 0; word < SF_SPIKE_WORDS; word++) rows[word] |= s->trace.spikes[presynaptic][t][word];
  put_bits(file, rows);
}

typedef enum { SPIKES, MEMBRANES, ROWS } tap_kind;
static const char *const tap_name[] = {"spikes", "membranes", "rows"};

static sf_status write_tap(sf_kit_output *output, const sf_kit_draw *d, tap_kind kind, int layer)
{
  const fx_net *net = &d->scene->net;
  sf_kit_writer file;
  char name[40];
  snprintf(name, sizeof name, "expected_%s_%s.hex", tap_name[kind], fx_layer_name(layer));
  SF_TRY(sf_kit_begin(output, &file, name));
  for (int i = 0; i < d->samples; i++)
    for (int t = 0; t < fx_layer_outputs(layer, net->steps); t++) switch (kind) {
      case SPIKES:
        put_spikes(file.writer.file, &d->sample[i], layer, t);
        break;
      case MEMBRANES:
        put_membranes(file.writer.file, net, &d->sample[i], layer, t);
        break;
      case ROWS:
        put_rows(file.writer.file, net, &d->sample[i], layer, t);
        break;
      }
  return sf_kit_end(output, &file);
}

static sf_status write_taps(sf_kit_output *output, const sf_kit_draw *d)
{
  for (int l = 0; l < SF_LAYERS; l++) {
    if (fx_layer_fires(l)) SF_TRY(write_tap(output, d, SPIKES, l));
    if (fx_layer_fires(l)) SF_TRY(write_tap(output, d, MEMBRANES, l));
    if (fx_layer_reads_spikes(l)) SF_TRY(write_tap(output, d, ROWS, l));
  }
  return sf_ok();
}

/* ---- counters ---- */

sf_status sf_kit_counters(sf_kit_output *output, const char *name, const fx_counts *counts)
{
  uint64_t window[WINDOW] = {0};
  sf_kit_writer file;
  for (int e = 0; e < SF_EVENTS; e++)
    for (int l = 0; l < SF_LAYERS; l++)
      for (int t = 0; t < SF_T_MAX; t++) window[(e * 8 + l) * 8 + t] = counts->layer[l].event[e][t];
  window[GLOBAL_LAYER * 8 + GLOBAL_SAMPLES] = counts->samples;
  window[GLOBAL_LAYER * 8 + GLOBAL_RAYS] = counts->rays;
  SF_TRY(sf_kit_begin(output, &file, name));
  for (int i = 0; i < WINDOW; i++) fprintf(file.writer.file, "%016" PRIx64 "\n", window[i]);
  return sf_kit_end(output, &file);
}

/* ---- sizes ---- */

static void put_sizes(FILE *file, const fx_net *net, const char *name, bool outputs)
{
  fprintf(file, "localparam [79:0] %s = 80'h", name);
  for (int l = SF_LAYERS - 1; l >= 0; l--)
    fprintf(file, "%04x", (unsigned)(outputs ? net->layer[l].n_out : net->layer[l].n_in));
  fprintf(file, ";  // 16 bits a layer: C3 C2 C1 D2 D1\n");
}

/* event_name(e), for messages. */
static void put_event_names(FILE *file)
{
  fputs("function automatic [127:0] event_name(input [2:0] e);\n  case (e)\n", file);
#define EVENT(id, name, title, unit, fj) fprintf(file, "    %d: event_name = \"" #name "\";\n", SF_EVENT_##id);
  SF_EVENT_TABLE(EVENT)
#undef EVENT
  fputs("  endcase\nendfunction\n", file);
}

static sf_status write_parameters(sf_kit_output *output, const fx_net *net, const sf_kit_options *o,
                                  const sf_kit_report *report)
{
  sf_kit_writer file;
  int rows = 0;
  for (int l = 0; l < SF_LAYERS; l++) rows += fx_layer_rows(&net->layer[l]);
  SF_TRY(sf_kit_begin(output, &file, "sf_kit_params.svh"));
  FILE *f = file.writer.file;
  fprintf(f, "// Sizes of this kit, the registers its bench uses and the names of the counters.\n");
  fprintf(f, "localparam integer SAMPLES = %d;\nlocalparam integer STEPS = %d;\n", report->samples, net->steps);
  fprintf(f, "localparam integer BEATS = %d;\nlocalparam integer WRITES = %d;\n", report->beats, report->writes);
  fprintf(f, "localparam integer WEIGHT_ROWS = %d;\nlocalparam [31:0] SEED = 32'h%08" PRIx32 ";\n", rows,
          (uint32_t)(o->seed ^ o->seed >> 32));
  put_sizes(f, net, "N_IN", false);
  put_sizes(f, net, "N_OUT", true);
  fprintf(f, "localparam integer LANES = %d;\nlocalparam integer BIAS_ROW = %d;\nlocalparam [4:0] BIASES = 5'b",
          SF_LANES, SF_BIAS_ROW);
  for (int l = SF_LAYERS - 1; l >= 0; l--) fputc(net->layer[l].bias ? '1' : '0', f);
  fputs(";  // layers that have them\n", f);
#define SF_CSR(name, offset, access, reset, meaning)                                                                   \
  if (offset < SF_CSR_MODE || offset > SF_CSR_C3_THETA)                                                                \
    fprintf(f, "localparam [12:0] CSR_%s = 13'h%04x;\nlocalparam [31:0] CSR_%s_RESET = 32'h%08x;\n", #name,            \
            (unsigned)(offset), #name, (unsigned)(reset));
#include "spikefield/csr.def"
#undef SF_CSR
  fprintf(f, "localparam [31:0] STATUS_COUNTERS = 32'h%08x;\n", (unsigned)SF_CSR_STATUS_COUNTERS);
  put_event_names(f);
  fprintf(f, "localparam [31:0] CTRL_SNAPSHOT = 32'h%08x;\n", (unsigned)SF_CSR_CTRL_SNAPSHOT);
  return sf_kit_end(output, &file);
}

sf_status sf_kit_images(sf_kit_output *output, const sf_kit_draw *draw, const sf_kit_options *options,
                        sf_kit_report *report)
{
  const fx_net *net = &draw->scene->net;
  SF_TRY(write_program(output, net, &report->writes));
  SF_TRY(write_weights(output, net));
  SF_TRY(write_stimulus(output, draw, &report->beats));
  SF_TRY(write_outputs(output, draw));
  SF_TRY(write_taps(output, draw));
  SF_TRY(sf_kit_counters(output, "expected_counters.hex", &draw->counts));
  return write_parameters(output, net, options, report);
}
