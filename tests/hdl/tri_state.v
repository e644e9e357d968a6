// The wrapper of a sun sensor's FPGA lets go of its pins.
`timescale 1ns/1ps
module bench;
  reg EN = 1, RNW = 1, CLK = 0, EDGE = 0, SHIFT = 0, PCLK = 0;
  reg drive = 0;
  wire ACK, CE_N, OE_N, WE_N;
  wire [7:0] DATA, LINK_D, SRAM_D;
  wire [1:0] LINK_C;
  wire [18:0] SRAM_A;
  assign SRAM_D = OE_N ? 8'bz : 8'h5A;
  assign LINK_D = drive ? 8'h3C : 8'bz;
  pullup (LINK_C[0]);
  pullup (LINK_C[1]);
  cubesense_sun dut (
    .Y(8'h0), .HREF(1'b0), .PCLK(PCLK), .EN(EN), .RNW(RNW), .CLK(CLK), .EDGE(EDGE), .SHIFT(SHIFT),
    .ACK(ACK), .DATA(DATA), .LINK_D(LINK_D), .LINK_C(LINK_C), .SRAM_A(SRAM_A), .SRAM_D(SRAM_D),
    .SRAM_CE_N(CE_N), .SRAM_OE_N(OE_N), .SRAM_WE_N(WE_N));
  task expect_(input [255:0] what, input good);
    if (!good) begin $display("wrong: %0s", what); $finish; end
  endtask
  initial begin
    #10 PCLK = 1; #10 PCLK = 0;
    #10 expect_("standby", DATA === 8'bz && LINK_D === 8'bz && SRAM_D === 8'bz && LINK_C === 2'b11);
    EN = 0;
    #10 expect_("reading", DATA === 8'h00 && LINK_D === 8'bz && LINK_C === 2'b10);
    CLK = 1;
    #10 expect_("byte", DATA === 8'h5A && SRAM_A === 19'h1);
    EN = 1;
    #10 expect_("standby again", DATA === 8'bz && SRAM_A === 19'h0);
    SHIFT = 1; RNW = 0; EN = 0;
    #10 expect_("sending", LINK_D === 8'h00 && LINK_C === 2'b00 && DATA === 8'bz);
    PCLK = 1;
    #10 expect_("sending its clock", LINK_C === 2'b01);
    $display("good"); $finish;
  end
endmodule
