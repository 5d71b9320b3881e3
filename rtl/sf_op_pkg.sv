// Encodings shared by the sequencer, the lanes and the counters.
package sf_op_pkg;
  // Input modes. Mirror: include/spikefield/fx.h (fx_input_mode)
  localparam [1:0] HYBRID = 2'd0;
  localparam [1:0] DECAY = 2'd1;
  localparam [1:0] NODECAY = 2'd2;

  // Layers. Mirror: include/spikefield/fx.h (fx_layer_id)
  localparam [2:0] D1 = 3'd0;
  localparam [2:0] D2 = 3'd1;
  localparam [2:0] C1 = 3'd2;
  localparam [2:0] C2 = 3'd3;
  localparam [2:0] C3 = 3'd4;

  // What the lanes do in one cycle.
  localparam [2:0] NOP = 3'd0;
  localparam [2:0] LOAD = 3'd1;  // acc = 0, or the direction's current
  localparam [2:0] MAC = 3'd2;   // acc += row * value
  localparam [2:0] ADD = 3'd3;   // acc += row: one presynaptic neuron fired
  localparam [2:0] SPLIT = 3'd4; // lanes as 8 steps x 16 outputs: acc[t][o] += fired[t] ? narrow row[o] : 0
  localparam [2:0] FIRE = 3'd5;  // one neuron step of every lane
  localparam [2:0] KEEP = 3'd6;  // direction's current = acc
  localparam [2:0] TAKE = 3'd7;  // currents of an integrating layer = acc
endpackage
