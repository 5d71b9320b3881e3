/* Open, program, count: everything but the streams. */
#include "sim/sim.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

enum { RESET_CYCLES = 4 };

const sf_error_source sf_dut_error = {SF_CSR_ERROR, sf_driver_error_text};

const char *sf_dut_error_text(sf_dut *dut, const sf_error_source *error)
{
  const uint32_t value = dut->bus.read(dut->bus.context, error->offset);
  return dut->bus_hung ? "registers do not answer" : error->text(value);
}

const sf_bus *sf_dut_driver_bus(sf_dut *dut)
{
  dut->bus_fault.what = NULL;
  return &dut->bus;
}

sf_status sf_dut_driver_status(sf_dut *dut, sf_driver_code code, const char *what, const sf_error_source *error)
{
  if (dut->out.finished) return sf_fail(SF_E_DIFFERENCE, "accelerator: %s: the simulation ended by itself", what);
  if (dut->bus_fault.what && (dut->bus_fault.early || dut->bus_hung || code != SF_DRIVER_REFUSED))
    return sf_fail(SF_E_UNSUPPORTED, "accelerator: %s: access to register %03" PRIx32 " %s at cycle %" PRIu64, what,
                   dut->bus_fault.offset, dut->bus_fault.what, dut->bus_fault.cycle);
  if (dut->bus_hung)
    return sf_fail(SF_E_UNSUPPORTED, "accelerator: %s: register access not answered at cycle %" PRIu64, what,
                   dut->cycle);
  if (code == SF_DRIVER_OK) return sf_ok();
  if (code != SF_DRIVER_REFUSED)
    return sf_fail(SF_E_UNSUPPORTED, "accelerator: %s: %s at cycle %" PRIu64, what, sf_driver_text(code), dut->cycle);
  return sf_fail(SF_E_UNSUPPORTED, "accelerator: %s: %s: %s", what, sf_driver_text(code),
                 sf_dut_error_text(dut, error));
}

static sf_status driver_status(sf_dut *dut, sf_driver_code code, const char *what)
{
  return sf_dut_driver_status(dut, code, what, &sf_dut_error);
}

sf_status sf_dut_open_pins(sf_dut **dut_out, const sf_dut_options *options, sf_pins_opener open)
{
  *dut_out = NULL;
  if (options->stall_percent < 0 || options->stall_percent > 90)
    return sf_fail(SF_E_RANGE, "accelerator: stall percentage is %d, expected 0..90", options->stall_percent);
  sf_dut *dut = calloc(1, sizeof *dut);
  if (!dut) return sf_fail(SF_E_MEMORY, "accelerator: out of memory");
  dut->pins = open(options->seed, options->wave, options->plusarg);
  if (!dut->pins) {
    free(dut);
    return options->wave ? sf_fail(SF_E_IO, "%s: cannot write the waveform", options->wave)
                         : sf_fail(SF_E_MEMORY, "accelerator: out of memory");
  }
  dut->seed = options->seed;
  dut->stall_percent = (uint32_t)options->stall_percent;
  dut->wave_from = options->wave_from;
  dut->bus = sf_dut_bus(dut);
  dut->cover = sf_cover_open();
  for (int i = 0; i < RESET_CYCLES; i++) sf_dut_tick(dut);
  dut->in.rst_n = true;
  sf_dut_tick(dut);
  const sf_status status = driver_status(dut, sf_driver_probe(sf_dut_driver_bus(dut)), "probe");
  if (status.code != SF_OK) {
    sf_dut_close(dut);
    return status;
  }
  *dut_out = dut;
  return status;
}

sf_status sf_dut_open_bare(sf_dut **dut, const sf_dut_options *options)
{
  return sf_dut_open_pins(dut, options, sf_pins_open);
}

sf_status sf_dut_load(sf_dut *dut, const fx_net *net)
{
  const sf_net_blob blob = sf_dut_blob(net);
  const sf_driver_code code = sf_driver_load(sf_dut_driver_bus(dut), &blob);
  if (code == SF_DRIVER_OK) dut->bus.write(dut->bus.context, SF_CSR_IRQ_ENABLE, SF_CSR_IRQ_ENABLE_ERROR);
  SF_TRY(driver_status(dut, code, "load"));
  dut->net = *net;
  return sf_dut_clear_counts(dut);
}

sf_status sf_dut_open(sf_dut **dut_out, const fx_scene *scene, const sf_dut_options *options)
{
  sf_dut *dut;
  *dut_out = NULL;
  SF_TRY(sf_dut_open_bare(&dut, options));
  const sf_status status = sf_dut_load(dut, &scene->net);
  if (status.code == SF_OK)
    *dut_out = dut;
  else
    sf_dut_close(dut);
  return status;
}

sf_status sf_dut_clear_counts(sf_dut *dut)
{
  return driver_status(dut, sf_driver_clear(sf_dut_driver_bus(dut)), "clear counters");
}

sf_status sf_dut_counts(sf_dut *dut, fx_counts *counts, uint64_t *cycles, uint64_t *busy, uint64_t *stalls)
{
  sf_driver_counters read;
  SF_TRY(driver_status(dut, sf_driver_read_counters(sf_dut_driver_bus(dut), &read), "read counters"));
  sf_dut_counts_of(&read, counts);
  if (cycles) *cycles = read.cycles;
  if (busy) *busy = read.busy;
  if (stalls) *stalls = read.stall_in + read.stall_out;
  memcpy(dut->layer_busy, read.layer_busy, sizeof dut->layer_busy);
  return sf_ok();
}

const uint64_t *sf_dut_layer_busy(const sf_dut *dut)
{
  return dut->layer_busy;
}

uint64_t sf_dut_cycle(const sf_dut *dut)
{
  return dut->cycle;
}

void sf_dut_close(sf_dut *dut)
{
  if (!dut) return;
  sf_pins_close(dut->pins);
  sf_cover_close(dut->cover);
  free(dut);
}
