// Volume rendering of one ray after the other, front to back. Mirror: src/fx/composite.c
// The weights telescope (w = transmittance before - after), so weight_sum + transmittance is 1.0 = 2^20 at all times.
//
// A ray is its samples in order, the first with first_i, the last with last_i. It stops early, as the fixed-point core
// does, when its transmittance is at most trans_stop_i or it has max_samples_i samples: its pixel leaves, stop_o tells
// that no more of its samples are needed, and those that still come are swallowed without an effect. With empty_i the
// ray has no sample and its pixel is the background.
// One multiplier of 28 x 25 bits, four of the device's, shared: operands, partial products and sum have a register each.
// 21 cycles per sample and 7 more per pixel. What a sample adds to the pixel arrives while the next one begins.
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
    // or samples whose weights are known: sigma_i and delta_i are not read, and last_i is that of where the ray stops
    input  wire         weighed_i,
    input  wire [ 20:0] weight_i,        // Q.20
    input  wire         decoded_i,       // else without a colour
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
  localparam [20:0] ONE = 21'd1 << 20;

  // The state counts the cycles since the sample was taken. The product that one of these asks for is in product_q three
  // cycles later.
  localparam [4:0] IDLE = 5'd0;  // sigma * delta of the sample that is taken, then nine cycles of sf_exp_neg
  localparam [4:0] ATTENUATE = 5'd12;  // transmittance * exp(-tau)
  localparam [4:0] WEIGH = 5'd15;  // the new transmittance; what was lost is the weight
  localparam [4:0] RED = 5'd16;  // weight * colour
  localparam [4:0] GREEN = 5'd17;
  localparam [4:0] BLUE = 5'd18;
  localparam [4:0] NEAR = 5'd19;  // weight * distance, in two halves
  localparam [4:0] FAR = 5'd20;  // and whether the ray ends here
  localparam [4:0] BACK_RED = 5'd21;  // transmittance * background
  localparam [4:0] BACK_GREEN = 5'd22;
  localparam [4:0] BACK_BLUE = 5'd23;
  localparam [4:0] PIXEL = 5'd27;
  reg [4:0] state_q;
  reg open_q;  // a ray that has not stopped

  reg last_q;
  reg [59:0] colour_q;
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
  reg stops_q;
  always_ff @(posedge clk_i) stops_q <= transmittance_q <= {1'b0, trans_stop_i} || samples_q >= max_samples_i;
  wire ends = last_q || (stops_q && !weighed_i);
  assign stop_o = state_q == FAR && ends && !last_q;

  // ---- the multiplier
  wire of_transmittance = state_q == ATTENUATE || state_q >= BACK_RED;
  wire [27:0] a = state_q == IDLE ? sigma_i : {7'd0, of_transmittance ? transmittance_q : weight_q};
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
      IDLE: b = delta_i;
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
  wire [52:0] product;
  sf_mul_28x25 u_mul (
      .clk_i    (clk_i),
      .a_i      (a),
      .b_i      (b),
      .of_tau_i (state_q == IDLE),
      .product_o(product)
  );

  sf_exp_neg u_exp_neg (
      .clk_i(clk_i),
      .tau_i(product[52:16]),
      .e_o  (e)
  );
  // Half an LSB more rounds half up. It is <= transmittance_q, since exp(-tau) <= 1.
  wire [20:0] after = product[40:20] + {20'd0, product[19]};
  wire [20:0] lost = transmittance_q - product[40:20] - {20'd0, product[19]};

  // What the products are added to.
  localparam [2:0] NOTHING = 3'd0, TO_RED = 3'd1, TO_GREEN = 3'd2, TO_BLUE = 3'd3, TO_NEAR = 3'd4, TO_FAR = 3'd5;
  reg [2:0] to, to1_q, to2_q, to3_q;
  always_comb begin
    case (state_q)
      RED, BACK_RED: to = TO_RED;
      GREEN, BACK_GREEN: to = TO_GREEN;
      BLUE, BACK_BLUE: to = TO_BLUE;
      NEAR: to = TO_NEAR;
      FAR: to = TO_FAR;
      default: to = NOTHING;
    endcase
  end

  // ---- sequence
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      state_q <= IDLE;
      open_q <= 1'b0;
      {to1_q, to2_q, to3_q} <= {3{NOTHING}};
    end else if (clear_i) begin
      state_q <= IDLE;
      open_q <= 1'b0;
      {to1_q, to2_q, to3_q} <= {3{NOTHING}};
    end else begin
      {to1_q, to2_q, to3_q} <= {to, to1_q, to2_q};
      case (state_q)
        IDLE: if (take && !ignored) begin
          state_q <= empty_i ? BACK_RED : !weighed_i ? 5'd1 : decoded_i ? RED : NEAR;
          open_q <= 1'b1;
        end
        FAR: state_q <= ends ? BACK_RED : IDLE;
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
      colour_q <= colour_i;
      distance_q <= distance_i;
    end
    if (take && weighed_i) weight_q <= weight_i;
    if (begins) begin
      transmittance_q <= weighed_i && !empty_i ? ONE - weight_i : ONE;
      weight_sum_q <= 21'd0;
      samples_q <= {10'd0, weighed_i && !empty_i && decoded_i};
      {red_q, green_q, blue_q} <= 120'd0;
      depth_q <= 64'd0;
    end else begin
      if (take && weighed_i) begin
        transmittance_q <= transmittance_q - weight_i;
        samples_q <= samples_q + {10'd0, decoded_i};
      end else if (state_q == WEIGH) begin
        transmittance_q <= after;
        weight_q <= lost;
        samples_q <= samples_q + 11'd1;
      end
      if (state_q == NEAR) weight_sum_q <= weight_sum_q + weight_q;
      // Weights and the transmittance left sum to 2^20, so a colour stays below 2^40 and the depth below 2^64.
      case (to3_q)
        TO_RED: red_q <= red_q + product[39:0];
        TO_GREEN: green_q <= green_q + product[39:0];
        TO_BLUE: blue_q <= blue_q + product[39:0];
        TO_NEAR: depth_q <= depth_q + {11'd0, product};
        TO_FAR: depth_q <= depth_q + {product[41:0], 22'd0};
        default: ;
      endcase
    end
  end

  assign colour_o = {blue_q, green_q, red_q};
  assign depth_o = depth_q;
  assign weight_sum_o = weight_sum_q;
  assign transmittance_o = transmittance_q;
  assign samples_o = samples_q;
endmodule

`default_nettype wire
