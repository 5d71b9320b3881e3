// Encodings shared by the sequencer, the lanes and the counters.
package sf_op_pkg;
  // Input modes. Mirror: src/fx/fx.h (fx_input_mode)
  localparam [1:0] HYBRID = 2'd0;
  localparam [1:0] DECAY = 2'd1;
  localparam [1:0] NODECAY = 2'd2;
  localparam [1:0] RADIX = 2'd3;

  // Layers. Mirror: src/fx/fx.h (fx_layer_id)
  localparam [2:0] D1 = 3'd0;
  localparam [2:0] D2 = 3'd1;
  localparam [2:0] C1 = 3'd2;
  localparam [2:0] C2 = 3'd3;
  localparam [2:0] C3 = 3'd4;

  // Numbers of the spiking layers among those that share the neurons
  localparam [1:0] SPIKING_D1 = 2'd0;
  localparam [1:0] SPIKING_C1 = 2'd1;
  localparam [1:0] SPIKING_C2 = 2'd2;
endpackage
