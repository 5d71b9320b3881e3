// Volume rendering of one ray after the other, front to back. Mirror: src/fx/composite.c
// The weights telescope (w = transmittance before - after), so weight_sum + transmittance is 1.0 = 2^20 at all times.
//
// A ray is its samples in order, the first with first_i, the last with last_i. It stops early, as the fixed-point core
// does, when its transmittance is at most trans_stop_i or it has max_samples_i samples: its pixel leaves, stop_o tells
// that no more of its samples are needed, and those that still come are swallowed without an effect. With empty_i the
// ray has no sample and its pixel is the background.
// One multiplier of 28 x 25 bits, shared: 12 cycles per sample and 5 more per pixel.
`default_nettype none

module sf_composite (
    input  wire         clk_i,
    input  wire         rst_ni,
    input  wire         clear_i,
    // programming
    input  wire [ 19:0] trans_stop_i,
    input  wire [ 10:0] max_samples_i,
    input  wire [ 50:0] background_i,    // 3 x U1.16
    // samples
    input  wire         valid_i,
    output wire         ready_o,
    input  wire         first_i,
    input  wire         last_i,
    input  wire         empty_i,
    input  wire [ 27:0] sigma_i,         // U16.12 per box edge
    input  wire [ 59:0] colour_i,        // 3 x U4.16
    input  wire [ 24:0] delta_i,         // Q1.24 box edges
    input  wire [ 43:0] distance_i,      // lattice steps, U28.16
    output wire         stop_o,
    output wire         idle_o,
    // pixels
    output wire         valid_o,
    input  wire         ready_i,
    output wire [119:0] colour_o,        // 3 x Q4.36
    output wire [ 63:0] depth_o,
    output wire [ 20:0] weight_sum_o,
    output wire [ 20:0] transmittance_o,
    output wire [ 10:0] samples_o
);
  `include "sf_round.svh"

  localparam [20:0] ONE = 21'd1 << 20;
  localparam [5:0] TAU_SHIFT = 6'd16;  // SIGMA_FRAC + DELTA_FRAC - TRANS_FRAC
  localparam [4:0] TRANS_FRAC = 5'd20;

  // A product that one of these asks for is in product_q during the next.
  localparam [4:0] IDLE = 5'd0;
  localparam [4:0] TAU = 5'd1;  // sigma * delta, then two cycles of sf_exp_neg
  localparam [4:0] ATTENUATE = 5'd4;  // transmittance * exp(-tau)
  localparam [4:0] WEIGH = 5'd5;  // the new transmittance; what was lost is the weight
  localparam [4:0] RED = 5'd6;  // weight * colour
  localparam [4:0] GREEN = 5'd7;
  localparam [4:0] BLUE = 5'd8;
  localparam [4:0] NEAR = 5'd9;  // weight * distance, in two halves
  localparam [4:0] FAR = 5'd10;
  localparam [4:0] DECIDE = 5'd11;
  localparam [4:0] BACK_RED = 5'd12;  // transmittance * background
  localparam [4:0] BACK_GREEN = 5'd13;
  localparam [4:0] BACK_BLUE = 5'd14;
  localparam [4:0] FINISH = 5'd15;
  localparam [4:0] PIXEL = 5'd16;
  reg [4:0] state_q;
  reg open_q;  // a ray that has not stopped

  reg last_q;
  reg [27:0] sigma_q;
  reg [59:0] colour_q;
  reg [24:0] delta_q;
  reg [43:0] distance_q;

  reg [39:0] red_q, green_q, blue_q;
  reg [63:0] depth_q;
  reg [20:0] weight_sum_q, transmittance_q, weight_q;
  reg [10:0] samples_q;

  assign ready_o = state_q == IDLE;
  assign idle_o = state_q == IDLE && !open_q;
  assign valid_o = state_q == PIXEL;
  wire take = valid_i && ready_o;
  wire begins = take && (first_i || empty_i);
  wire ignored = take && !begins && !open_q;
  wire stops = transmittance_q <= {1'b0, trans_stop_i} || samples_q >= max_samples_i;
  assign stop_o = state_q == DECIDE && stops && !last_q;

  // ---- the multiplier
  wire of_transmittance = state_q == ATTENUATE || state_q >= BACK_RED;
  wire [27:0] a = state_q == TAU ? sigma_q : {7'd0, of_transmittance ? transmittance_q : weight_q};
  wire [20:0] e;
  wire [24:0] exp_tau = {4'd0, e};
  wire [24:0] red = {5'd0, colour_q[19:0]};
  wire [24:0] green = {5'd0, colour_q[39:20]};
  wire [24:0] blue = {5'd0, colour_q[59:40]};
  wire [24:0] near = {3'd0, distance_q[21:0]};
  wire [24:0] far = {3'd0, distance_q[43:22]};
  wire [24:0] back_red = {8'd0, background_i[16:0]};
  wire [24:0] back_green = {8'd0, background_i[33:17]};
  wire [24:0] back_blue = {8'd0, background_i[50:34]};
  reg [24:0] b;
  always_comb begin
    case (state_q)
      TAU: b = delta_q;
      ATTENUATE: b = exp_tau;
      RED: b = red;
      GREEN: b = green;
      BLUE: b = blue;
      NEAR: b = near;
      FAR: b = far;
      BACK_RED: b = back_red;
      BACK_GREEN: b = back_green;
      default: b = back_blue;
    endcase
  end
  reg [52:0] product_q;
  always_ff @(posedge clk_i) product_q <= 53'(a) * 53'(b);

  wire [63:0] tau = sf_rshift_round_wide({11'd0, product_q}, TAU_SHIFT);
  sf_exp_neg u_exp_neg (
      .clk_i(clk_i),
      .tau_i(tau[36:0]),
      .e_o  (e)
  );
  wire [47:0] attenuated = sf_rshift_round(product_q[47:0], TRANS_FRAC);
  wire [20:0] after = attenuated[20:0];  // <= transmittance_q, since exp(-tau) <= 1

  // ---- sequence
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      open_q <= 1'b0;
    end else if (clear_i) begin
      state_q <= IDLE;
      open_q <= 1'b0;
    end else begin
      case (state_q)
        IDLE: if (take && !ignored) begin
          state_q <= empty_i ? BACK_RED : TAU;
          open_q <= 1'b1;
        end
        DECIDE: state_q <= stops || last_q ? BACK_RED : IDLE;
        PIXEL: if (ready_i) begin
          state_q <= IDLE;
          open_q <= 1'b0;
        end
        default: state_q <= state_q + 5'd1;
      endcase
    end
  end

  always_ff @(posedge clk_i) begin
    if (take) begin
      last_q <= last_i;
      sigma_q <= sigma_i;
      colour_q <= colour_i;
      delta_q <= delta_i;
      distance_q <= distance_i;
    end
    if (begins) begin
      transmittance_q <= ONE;
      weight_sum_q <= 21'd0;
      samples_q <= 11'd0;
      {red_q, green_q, blue_q} <= 120'd0;
      depth_q <= 64'd0;
    end else begin
      case (state_q)
        WEIGH: begin
          transmittance_q <= after;
          weight_q <= transmittance_q - after;
          samples_q <= samples_q + 11'd1;
        end
        RED: weight_sum_q <= weight_sum_q + weight_q;
        // Weights and the transmittance left sum to 2^20, so a colour stays below 2^40 and the depth below 2^64.
        GREEN, BACK_GREEN: red_q <= red_q + product_q[39:0];
        BLUE, BACK_BLUE: green_q <= green_q + product_q[39:0];
        NEAR, FINISH: blue_q <= blue_q + product_q[39:0];
        FAR: depth_q <= depth_q + {11'd0, product_q};
        DECIDE: depth_q <= depth_q + {product_q[41:0], 22'd0};
        default: ;
      endcase
    end
  end

  assign colour_o = {blue_q, green_q, red_q};
  assign depth_o = depth_q;
  assign weight_sum_o = weight_sum_q;
  assign transmittance_o = transmittance_q;
  assign samples_o = samples_q;
  wire unused_ok = &{1'b0, tau[63:37], attenuated[47:21]};
endmodule

`default_nettype wire
