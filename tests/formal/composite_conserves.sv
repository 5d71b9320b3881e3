// Compositor: of every ray, ended by its last sample or early, the weights its samples were given and the transmittance
// left add up to 1.0 exactly; transmittance never rises; one pixel per ray; samples after an early stop have no effect.
// The multiplier is cut: any product of each of its parts, but transmittance * exp(-tau) at most the transmittance.
`default_nettype none

module composite_conserves (
    input wire         clk_i,
    input wire         clear_i,
    input wire         valid_i,
    input wire         first_i,
    input wire         last_i,
    input wire         empty_i,
    input wire [ 27:0] sigma_i,
    input wire [ 59:0] colour_i,
    input wire [ 24:0] delta_i,
    input wire [ 43:0] distance_i,
    input wire [ 50:0] background_i,
    input wire         ready_i
);
  localparam [20:0] ONE = 21'd1 << sf_arch_pkg::TRANS_FRAC;
  localparam [4:0] IDLE = 5'd0, WEIGH = 5'd15, RED = 5'd16, NEAR = 5'd19, FAR = 5'd20, BACK_RED = 5'd21, PIXEL = 5'd27;
  (* anyconst *) wire [19:0] trans_stop;
  (* anyconst *) wire [10:0] max_samples;
  reg rst_n_q = 1'b0;
  always @(posedge clk_i) rst_n_q <= 1'b1;

  wire ready, stop, idle, valid;
  wire [119:0] colour;
  wire [63:0] depth;
  wire [20:0] weight_sum, transmittance;
  wire [10:0] samples;
  sf_composite u_dut (
      .*,
      .rst_ni         (rst_n_q),
      .trans_stop_i   (trans_stop),
      .max_samples_i  (max_samples),
      .ready_o        (ready),
      .weighed_i      (1'b0),
      .weight_i       (21'd0),
      .decoded_i      (1'b0),
      .stop_o         (stop),
      .idle_o         (idle),
      .valid_o        (valid),
      .colour_o       (colour),
      .depth_o        (depth),
      .weight_sum_o   (weight_sum),
      .transmittance_o(transmittance),
      .samples_o      (samples)
  );
  wire [4:0] peek_state_q;
  wire peek_open_q, peek_last_q;
  wire [20:0] peek_weight_q;
  wire [52:0] peek_product;
  wire [27:0] peek_a;

  // The ray as its samples tell it: what it has lost at each of them.
  reg ray_q = 1'b0;    // begun, its pixel not yet gone
  reg ended_q = 1'b0;  // its last sample was taken, or it stopped
  reg [10:0] count_q;
  reg [20:0] given_q, before_q;
  wire take = valid_i && ready;
  wire begins = take && (first_i || empty_i);
  wire early = transmittance <= {1'b0, trans_stop} || count_q >= max_samples;
  always @(posedge clk_i) begin
    if (clear_i) {ray_q, ended_q} <= 2'd0;
    else if (rst_n_q) begin
      if (begins) ray_q <= 1'b1;
      else if (valid && ready_i) ray_q <= 1'b0;
      if (take) ended_q <= (begins || ray_q) && (empty_i || last_i);
      else if (peek_state_q == FAR && early) ended_q <= 1'b1;
      else if (valid && ready_i) ended_q <= 1'b0;
    end
    if (begins) begin
      count_q <= 11'd0;
      given_q <= 21'd0;
    end else if (peek_state_q == WEIGH) count_q <= count_q + 11'd1;
    else if (peek_state_q == NEAR) given_q <= given_q + peek_a[20:0];
    before_q <= transmittance;
  end

  wire [22:0] kept = {2'd0, weight_sum} + {2'd0, transmittance};
  wire [22:0] in_hand = peek_state_q >= RED && peek_state_q <= NEAR ? {2'd0, peek_weight_q} : 23'd0;
  wire [11:0] most = max_samples == 11'd0 ? 12'd1 : {1'b0, max_samples};
  always @* begin
    // exp_neg_one and mul_steps
    assume (peek_state_q != WEIGH || peek_product <= {32'd0, transmittance} << sf_arch_pkg::TRANS_FRAC);
    assume (!(take && ray_q && (first_i || empty_i)));  // sf_split: a ray ends before the next one begins
    if (rst_n_q) begin
      states : assert (peek_state_q <= PIXEL && ready == (peek_state_q == IDLE));
      one_ray : assert (peek_open_q == ray_q && (ray_q || peek_state_q == IDLE));
      in_the_end : assert (!ray_q || ended_q == (peek_state_q >= BACK_RED || (peek_state_q != IDLE && peek_last_q)));
      conserves_one : assert (!ray_q || kept + in_hand == {2'd0, ONE});
      sums_the_weights : assert (!ray_q || weight_sum == given_q);
      pixel_conserves_one : assert (!valid || ({1'b0, given_q} + {1'b0, transmittance} == {1'b0, ONE} && given_q == weight_sum));
      what_was_lost : assert (!ray_q || peek_state_q != RED || {1'b0, transmittance} + {1'b0, peek_weight_q} == {1'b0, before_q});
      never_rises : assert (!ray_q || peek_state_q != RED || transmittance <= before_q);
      one_weight : assert (peek_state_q < RED || peek_state_q > FAR || peek_a == {7'd0, peek_weight_q});
      counts : assert (!ray_q || (samples == count_q && {1'b0, samples} <= most));
      room : assert (peek_state_q == IDLE || peek_state_q > WEIGH || {1'b0, samples} < most);
      another_may_come : assert (!ray_q || peek_state_q != IDLE || !early);
      pixel_when_ended : assert (valid == (peek_state_q == PIXEL) && (!valid || (ray_q && ended_q)));
      stops_early : assert (stop == (peek_state_q == FAR && early && !peek_last_q));
      idle_without_a_ray : assert (idle == (!ray_q));
    end
  end
endmodule

`default_nettype wire
