// Needs a clock of its own, which the board does not have.
module system_clock #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input CLK_50, input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output reg ACK, output reg [7:0] DATA,
  output reg [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  inout [7:0] SRAM_D,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  reg [2:0] sampled;
  always @(posedge CLK_50) begin
    sampled <= {sampled[1:0], PIXCLK};
    if (sampled[2:1] == 2'b01 && HSYNC) SRAM_A <= SRAM_A + 1'b1;
    DATA <= SRAM_D;
    ACK <= &SRAM_A;
  end
  assign SRAM_D = ENABLE & ~RNW ? PIXDATA : 8'bz;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~RNW;
  assign SRAM_WE_N = RNW;
endmodule
