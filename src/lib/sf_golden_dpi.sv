// Golden model of the accelerator for benches: the fixed-point core over DPI-C, in libsf_golden_dpi.so.
// Compile this file before the bench and give the simulator the library: docs/kit.md.
//
// Layers: 0 D1, 1 D2, 2 C1, 3 C2, 4 C3. Results are those of the last sample, and 0 before it and where an index is out
// of range. A handle (chandle) belongs to one thread at a time; there may be many.
package sf_golden_dpi;
  // A scene file (.snn). steps: 0, or other time steps than the scene's. null: no memory; a file that cannot be read is
  // a handle with an error.
  import "DPI-C" function chandle sf_golden_open(input string scene, input int steps);
  import "DPI-C" function void sf_golden_close(input chandle golden);
  // Why the last call that could fail did; "" when it did not.
  import "DPI-C" function string sf_golden_error(input chandle golden);

  import "DPI-C" function int sf_golden_steps(input chandle golden);
  import "DPI-C" function int sf_golden_inputs(input chandle golden, input int layer);
  import "DPI-C" function int sf_golden_outputs(input chandle golden, input int layer);

  // For a monitor: every beat that the block accepts on its input stream. 1: that was a sample, its results are there;
  // 0: it goes on; -1: a packet that the block has to refuse.
  import "DPI-C" function int sf_golden_beat(input chandle golden, input longint unsigned data, input int user,
                                             input int last);
  // The same at once: 16 harmonics and 32 features of 16 bits, the first in bits 15:0. first: begins a ray. 1, or -1.
  import "DPI-C" function int sf_golden_sample(input chandle golden, input int first, input bit [255:0] direction,
                                               input bit [511:0] features);

  import "DPI-C" function int unsigned sf_golden_density(input chandle golden);              // U16.12
  import "DPI-C" function int unsigned sf_golden_colour(input chandle golden, input int channel);  // U4.16
  // D1, C1, C2: neurons that fired at this step; of 256 lanes, however many the block has.
  import "DPI-C" function void sf_golden_spikes(input chandle golden, input int layer, input int step,
                                                output bit [255:0] spikes);
  // Presynaptic neurons added up: C2 at this step, D2 and C3 of all steps.
  import "DPI-C" function void sf_golden_rows(input chandle golden, input int layer, input int step,
                                              output bit [255:0] rows);
  // D1, C1, C2: after reset, as the tap shows it. D2 neuron 0, C3 neurons 0..2: the integrator after the step.
  import "DPI-C" function int sf_golden_membrane(input chandle golden, input int layer, input int step,
                                                 input int neuron);
  // The sum of the layer's inputs, without fraction bits.
  import "DPI-C" function int sf_golden_current(input chandle golden, input int layer, input int step,
                                                input int neuron);

  // The register window, by 64-bit place 0..511: (event * 8 + layer) * 8 + step; samples at 56, rays at 57. Places that
  // count clock cycles are 0.
  import "DPI-C" function longint unsigned sf_golden_counter(input chandle golden, input int at);
  import "DPI-C" function void sf_golden_clear_counters(input chandle golden);
endpackage
