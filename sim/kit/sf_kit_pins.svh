// Of both benches: pins that both blocks have, the clock, and the verdict.
reg clk = 1'b0, rst_n = 1'b0;
reg awvalid = 1'b0, wvalid = 1'b0, bready = 1'b0, arvalid = 1'b0, rready = 1'b0;
reg [12:0] awaddr = 13'd0, araddr = 13'd0;
reg [31:0] wdata = 32'd0;
wire awready, wready, bvalid, arready, rvalid;
wire [1:0] bresp, rresp;
wire [31:0] rdata;
reg s_valid = 1'b0, s_user = 1'b0, s_last = 1'b0;
reg m_ready = 1'b0;
wire s_ready, m_valid, irq;

always #5 clk = !clk;

integer quiet = 0, patience;  // cycles without a sign of life, and how many end the run
integer cycle = 0;
task fail;
  begin
    $display("FAIL at cycle %0d", cycle);
    $fatal(1, "the block differs from the fixed-point core");
  end
endtask
