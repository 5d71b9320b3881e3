// Order of work for one sample: what the lanes do in each cycle. Mirror: src/fx/net.c
//
//   [direction rows, KEEP]  once per ray
//   D1 rows, D1 neurons of every step            its current does not change with the step
//   D2 rows of neurons active at any step, TAKE  lanes as 8 steps x 16 outputs
//   per step: h rows, C1 neurons, rows of firing C1 neurons, C2 neurons
//   C3 rows of neurons active at any step, TAKE
//
// Operations execute in order one cycle after they are issued here. A FIRE's spikes can be read two cycles after its
// issue, the store of all steps three: the LOAD between layers fills those slots.
`default_nettype none

module sf_sequencer (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,         // soft reset
    input  wire         hold_i,          // begin no sample
    input  wire         sample_valid_i,
    input  wire         sample_first_i,  // the sample brings a direction
    output wire         sample_done_o,   // its inputs were read for the last time
    input  wire [  5:0] n_feature_i,
    input  wire [  4:0] n_dir_i,
    input  wire [  4:0] n_h_i,
    input  wire [  3:0] steps_i,
    input  wire [127:0] spikes_now_i,    // C1 at the step at work
    input  wire [127:0] spikes_any_i,    // D1 or C2, union over steps
    input  wire         readout_ready_i,
    output reg  [  2:0] op_o,
    output wire [  2:0] layer_o,
    output wire [  2:0] step_o,
    output wire         base_o,
    output wire [  7:0] wide_row_o,
    output wire [  7:0] narrow_row_o,
    output wire [  5:0] value_index_o,
    output wire [  1:0] value_select_o,  // 0 feature, 1 direction, 2 h
    output wire [127:0] spike_mask_o,    // presynaptic neuron of this ADD or SPLIT
    output wire [  6:0] spike_index_o,
    output wire         idle_o,
    output wire         stall_o          // waits for the readout
);
  localparam [3:0] IDLE = 4'd0;
  localparam [3:0] DIR = 4'd1;
  localparam [3:0] DIR_KEEP = 4'd2;
  localparam [3:0] D1_LOAD = 4'd3;
  localparam [3:0] D1_ROWS = 4'd4;
  localparam [3:0] D1_FIRE = 4'd5;
  localparam [3:0] D2_LOAD = 4'd6;
  localparam [3:0] D2_WAIT = 4'd7;
  localparam [3:0] D2_ROWS = 4'd8;
  localparam [3:0] C1_LOAD = 4'd9;
  localparam [3:0] C1_ROWS = 4'd10;
  localparam [3:0] C1_FIRE = 4'd11;
  localparam [3:0] C2_LOAD = 4'd12;
  localparam [3:0] C2_ROWS = 4'd13;
  localparam [3:0] C3_LOAD = 4'd14;
  localparam [3:0] C3_ROWS = 4'd15;

  reg [3:0] state_q, state_d;
  reg [5:0] index_q, index_d;
  reg [2:0] step_q, step_d;
  reg       waited_q, waited_d;  // C3_LOAD takes two cycles
  reg       fresh_q, fresh_d;    // the bitmap of this layer was not looked at yet
  reg [127:0] pending_q;

  wire spike_any;
  wire [127:0] pending = !fresh_q ? pending_q : state_q == C2_ROWS ? spikes_now_i : spikes_any_i;
  sf_first u_first (
      .bits_i (pending),
      .any_o  (spike_any),
      .mask_o (spike_mask_o),
      .index_o(spike_index_o)
  );

  wire last_step = {1'b0, step_q} == steps_i - 4'd1;
  wire last_feature = index_q == n_feature_i - 6'd1;
  wire last_dir = index_q == {1'b0, n_dir_i} - 6'd1;
  wire last_h = index_q == {1'b0, n_h_i} - 6'd1;
  wire begin_sample = sample_valid_i && !hold_i;

  always_comb begin
    state_d = state_q;
    index_d = 6'd0;
    step_d = step_q;
    waited_d = 1'b0;
    fresh_d = 1'b0;
    op_o = sf_op_pkg::NOP;
    case (state_q)
      IDLE: begin
        step_d = 3'd0;
        if (begin_sample) begin
          op_o = sf_op_pkg::LOAD;
          state_d = !sample_first_i ? D1_ROWS : n_dir_i == 5'd0 ? DIR_KEEP : DIR;
        end
      end
      DIR: begin
        op_o = sf_op_pkg::MAC;
        index_d = index_q + 6'd1;
        if (last_dir) state_d = DIR_KEEP;
      end
      DIR_KEEP: begin
        op_o = sf_op_pkg::KEEP;
        state_d = D1_LOAD;
      end
      D1_LOAD: begin
        op_o = sf_op_pkg::LOAD;
        state_d = D1_ROWS;
      end
      D1_ROWS: begin
        op_o = sf_op_pkg::MAC;
        index_d = index_q + 6'd1;
        if (last_feature) state_d = D1_FIRE;
      end
      D1_FIRE: begin
        op_o = sf_op_pkg::FIRE;
        step_d = last_step ? 3'd0 : step_q + 3'd1;
        if (last_step) state_d = D2_LOAD;
      end
      D2_LOAD: begin
        op_o = sf_op_pkg::LOAD;
        state_d = D2_WAIT;
      end
      D2_WAIT: begin
        fresh_d = 1'b1;
        state_d = D2_ROWS;
      end
      D2_ROWS: begin
        if (spike_any) op_o = sf_op_pkg::SPLIT;
        else if (readout_ready_i) begin
          op_o = sf_op_pkg::TAKE;
          state_d = C1_LOAD;
        end
      end
      C1_LOAD: begin
        op_o = sf_op_pkg::LOAD;
        state_d = n_h_i == 5'd0 ? C1_FIRE : C1_ROWS;
      end
      C1_ROWS: begin
        op_o = sf_op_pkg::MAC;
        index_d = index_q + 6'd1;
        if (last_h) state_d = C1_FIRE;
      end
      C1_FIRE: begin
        op_o = sf_op_pkg::FIRE;
        state_d = C2_LOAD;
      end
      C2_LOAD: begin
        op_o = sf_op_pkg::LOAD;
        fresh_d = 1'b1;
        state_d = C2_ROWS;
      end
      C2_ROWS: begin
        if (spike_any) op_o = sf_op_pkg::ADD;
        else begin
          op_o = sf_op_pkg::FIRE;
          step_d = last_step ? 3'd0 : step_q + 3'd1;
          state_d = last_step ? C3_LOAD : C1_LOAD;
        end
      end
      C3_LOAD: begin
        if (!waited_q) op_o = sf_op_pkg::LOAD;
        waited_d = 1'b1;
        fresh_d = waited_q;
        if (waited_q) state_d = C3_ROWS;
      end
      default: begin  // C3_ROWS
        if (spike_any) op_o = sf_op_pkg::SPLIT;
        else if (readout_ready_i) begin
          op_o = sf_op_pkg::TAKE;
          state_d = IDLE;
        end
      end
    endcase
  end

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      index_q <= 6'd0;
      step_q <= 3'd0;
      waited_q <= 1'b0;
      fresh_q <= 1'b0;
    end else begin
      state_q <= clear_i ? IDLE : state_d;
      index_q <= clear_i ? 6'd0 : index_d;
      step_q <= step_d;
      waited_q <= !clear_i && waited_d;
      fresh_q <= !clear_i && fresh_d;
    end
  end

  always_ff @(posedge clk_i) pending_q <= pending & ~spike_mask_o;

  wire in_d1 = state_q == D1_ROWS || state_q == D1_FIRE;
  wire in_d2 = state_q == D2_ROWS;
  wire in_c2 = state_q == C2_ROWS;
  wire in_c3 = state_q == C3_ROWS;
  assign layer_o = in_d1 ? sf_op_pkg::D1 : in_d2 ? sf_op_pkg::D2 : in_c2 ? sf_op_pkg::C2
                 : in_c3 ? sf_op_pkg::C3 : sf_op_pkg::C1;
  assign step_o = step_q;
  assign base_o = state_q == C1_LOAD;

  // Wide rows: D1 0..31, C1 32..63 (direction first), C2 64..191. Narrow rows: D2 0..127, C3 128..255.
  assign wide_row_o = in_d1 ? {2'd0, index_q}
                    : in_c2 ? 8'd64 + {1'b0, spike_index_o}
                    : state_q == DIR ? 8'd32 + {2'd0, index_q}
                    : 8'd32 + {3'd0, n_dir_i} + {2'd0, index_q};
  assign narrow_row_o = {in_c3, spike_index_o};
  assign value_index_o = index_q;
  assign value_select_o = in_d1 ? 2'd0 : state_q == DIR ? 2'd1 : 2'd2;

  assign sample_done_o = state_q == D1_ROWS && last_feature && !clear_i;
  assign idle_o = state_q == IDLE;
  assign stall_o = (in_d2 || in_c3) && !spike_any && !readout_ready_i;
endmodule

`default_nettype wire
