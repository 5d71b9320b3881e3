// Grid features of positions, two per level, from a table in an external memory. Mirror: src/fx/grid.c (fx_grid_features)
//
// One request per cycle: 8 corners per level, levels in order. Answers come in the order of the requests after any time; up
// to 2^LOG2_DEPTH levels (8 requests each) are on their way or wait at the output, which hides a latency of that many
// requests. Room for the answers is reserved before the first request of a level, so they need no back-pressure.
// After a clear the memory still answers what it has accepted: those answers are discarded, and nothing is asked before the
// last of them has come.
`default_nettype none

module sf_grid #(
    parameter integer LOG2_DEPTH = 4
) (
    input  wire        clk_i,
    input  wire        rst_ni,
    input  wire        clear_i,
    input  wire        cfg_we_i,
    input  wire [ 6:0] cfg_addr_i,       // {level, parameter}, as sf_grid_cell
    input  wire [31:0] cfg_data_i,
    input  wire [ 3:0] last_level_i,
    input  wire        s_valid_i,
    output wire        s_ready_o,
    input  wire [71:0] s_pos_i,          // {z, y, x}, Q0.24
    output wire        mem_req_valid_o,
    input  wire        mem_req_ready_i,
    output wire [31:0] mem_req_addr_o,   // entry
    input  wire        mem_rsp_valid_i,
    input  wire [15:0] mem_rsp_data_i,   // {feature 1, feature 0}
    output wire        m_valid_o,
    input  wire        m_ready_i,
    output wire [23:0] m_features_o,     // {feature 1, feature 0}, 12 bits each
    output wire        m_last_o          // of the sample
);
  localparam integer COUNT = LOG2_DEPTH + 1;

  // Cells, one level at a time.
  wire cell_valid, cell_ready, cell_dense, cell_last;
  wire [15:0] cell_x;
  wire [31:0] cell_y0, cell_y1, cell_z0, cell_z1, cell_mask, cell_offset;
  wire [23:0] cell_place;
  wire [4:0] cell_shift;
  sf_grid_cell u_cell (
      .clk_i       (clk_i),
      .rst_ni      (rst_ni),
      .clear_i     (clear_i),
      .cfg_we_i    (cfg_we_i),
      .cfg_addr_i  (cfg_addr_i),
      .cfg_data_i  (cfg_data_i),
      .last_level_i(last_level_i),
      .s_valid_i   (s_valid_i),
      .s_ready_o   (s_ready_o),
      .s_pos_i     (s_pos_i),
      .valid_o     (cell_valid),
      .ready_i     (cell_ready),
      .dense_o     (cell_dense),
      .x_o         (cell_x),
      .y0_o        (cell_y0),
      .y1_o        (cell_y1),
      .z0_o        (cell_z0),
      .z1_o        (cell_z1),
      .mask_o      (cell_mask),
      .offset_o    (cell_offset),
      .place_o     (cell_place),
      .shift_o     (cell_shift),
      .last_o      (cell_last)
  );

  // A level at work, corner by corner: x with y, then index, then address.
  reg [COUNT-1:0] reserved_q;  // levels between their first request and the output
  reg room_q;
  reg work_q, pair_valid_q, index_valid_q, request_q;
  reg [2:0] corner_q;
  reg dense_q, pair_dense_q;
  reg [15:0] x0_q;
  reg [16:0] x1_q;
  reg [31:0] y0_q, y1_q, z0_q, z1_q, mask_q, offset_q;
  reg [31:0] pair_q, pair_z_q, pair_mask_q, pair_offset_q, index_q, index_offset_q, addr_q;
  wire request_ready = !request_q || (mem_req_valid_o && mem_req_ready_i);
  wire index_ready = !index_valid_q || request_ready;
  wire pair_ready = !pair_valid_q || index_ready;
  wire work_end = work_q && pair_ready && corner_q == 3'd7;
  wire load = cell_valid && cell_ready;
  wire leaves = m_valid_o && m_ready_i;
  wire [COUNT-1:0] reserved = load == leaves ? reserved_q : load ? reserved_q + 1'b1 : reserved_q - 1'b1;
  assign cell_ready = (!work_q || work_end) && room_q;

  wire [31:0] corner_x = {15'd0, corner_q[0] ? x1_q : {1'b0, x0_q}};
  wire [31:0] corner_y = corner_q[1] ? y1_q : y0_q;
  wire [31:0] corner_z = corner_q[2] ? z1_q : z0_q;

  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      {work_q, pair_valid_q, index_valid_q, request_q} <= 4'd0;
      reserved_q <= '0;
    end else if (clear_i) begin
      {work_q, pair_valid_q, index_valid_q, request_q} <= 4'd0;
      reserved_q <= '0;
    end else begin
      if (load) work_q <= 1'b1;
      else if (work_end) work_q <= 1'b0;
      if (pair_ready) pair_valid_q <= work_q;
      if (index_ready) index_valid_q <= pair_valid_q;
      if (request_ready) request_q <= index_valid_q;
      reserved_q <= reserved;
    end
  end

  // No cell comes in the first cycle after a reset or a clear, in which this may still be of before.
  always_ff @(posedge clk_i) room_q <= !reserved[LOG2_DEPTH];

  always_ff @(posedge clk_i) begin
    if (load) begin
      corner_q <= 3'd0;
      dense_q <= cell_dense;
      x0_q <= cell_x;
      x1_q <= {1'b0, cell_x} + 17'd1;
      {y0_q, y1_q} <= {cell_y0, cell_y1};
      {z0_q, z1_q} <= {cell_z0, cell_z1};
      {mask_q, offset_q} <= {cell_mask, cell_offset};
    end else if (work_q && pair_ready) begin
      corner_q <= corner_q + 3'd1;
    end
    if (pair_ready) begin
      pair_q <= dense_q ? corner_x + corner_y : corner_x ^ corner_y;
      pair_z_q <= corner_z;
      {pair_dense_q, pair_mask_q, pair_offset_q} <= {dense_q, mask_q, offset_q};
    end
    if (index_ready) begin
      index_q <= pair_dense_q ? pair_q + pair_z_q : (pair_q ^ pair_z_q) & pair_mask_q;
      index_offset_q <= pair_offset_q;
    end
    if (request_ready) addr_q <= index_q + index_offset_q;
  end

  // Requests that the memory has accepted and not answered; those of before a clear are stale.
  reg [LOG2_DEPTH+3:0] outstanding_q, stale_q;
  wire accepted = mem_req_valid_o && mem_req_ready_i;
  wire [LOG2_DEPTH+3:0] outstanding =
      outstanding_q + {{LOG2_DEPTH + 3{1'b0}}, accepted} - {{LOG2_DEPTH + 3{1'b0}}, mem_rsp_valid_i};
  wire draining = stale_q != '0;
  wire answer = mem_rsp_valid_i && !draining;
  assign mem_req_valid_o = request_q && !draining;
  assign mem_req_addr_o = addr_q;
  always_ff @(posedge clk_i or negedge rst_ni) begin
    if (!rst_ni) begin
      outstanding_q <= '0;
      stale_q <= '0;
    end else begin
      outstanding_q <= outstanding;
      if (clear_i) stale_q <= outstanding;
      else if (draining && mem_rsp_valid_i) stale_q <= stale_q - 1'b1;
    end
  end

  // Answers to features.
  wire [23:0] waiting_place, pair;
  wire [4:0] waiting_shift;
  wire waiting_last, waiting_valid, pop, pair_valid, pair_last;
  sf_fifo #(
      .WIDTH     (30),
      .LOG2_DEPTH(LOG2_DEPTH)
  ) u_waiting (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (load),
      .data_i ({cell_place, cell_shift, cell_last}),
      .valid_o(waiting_valid),
      .pop_i  (pop),
      .data_o ({waiting_place, waiting_shift, waiting_last})
  );
  sf_trilinear u_trilinear (
      .clk_i     (clk_i),
      .rst_ni    (rst_ni),
      .clear_i   (clear_i),
      .valid_i   (answer),
      .entry_i   (mem_rsp_data_i),
      .place_i   (waiting_place),
      .shift_i   (waiting_shift),
      .last_i    (waiting_last),
      .pop_o     (pop),
      .valid_o   (pair_valid),
      .features_o(pair),
      .last_o    (pair_last)
  );
  sf_fifo #(
      .WIDTH     (25),
      .LOG2_DEPTH(LOG2_DEPTH)
  ) u_features (
      .clk_i  (clk_i),
      .rst_ni (rst_ni),
      .clear_i(clear_i),
      .push_i (pair_valid),
      .data_i ({pair, pair_last}),
      .valid_o(m_valid_o),
      .pop_i  (m_valid_o && m_ready_i),
      .data_o ({m_features_o, m_last_o})
  );
  wire unused_ok = &{1'b0, waiting_valid};
endmodule

`default_nettype wire
