// Clocks that come out of logic and out of registers: a gated pixel clock, and a row clock.
module generated_clock #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output reg ACK, output reg [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  wire storing = ENABLE & ~RNW;
  wire frame = storing & VSYNC;

  // Enabled from the first gap between two rows of a frame.
  reg armed;
  always @(negedge PIXCLK or negedge frame)
    if (!frame) armed <= 0;
    else if (!HSYNC) armed <= 1;

  wire pixel_clock = PIXCLK & armed;
  reg [CW-1:0] column;
  reg [7:0] pixel;
  reg write, over;
  always @(posedge pixel_clock or negedge frame)
    if (!frame) begin column <= 0; write <= 0; over <= 0; pixel <= 0; end
    else begin
      pixel <= PIXDATA;
      write <= HSYNC & ~over & ~(write & column == COLUMNS - 1) & ~ACK;
      if (!HSYNC) begin column <= 0; over <= 0; end
      else if (write) begin
        if (column == COLUMNS - 1) over <= 1;
        else column <= column + 1'b1;
      end
      if (write && column == COLUMNS - 1) column <= 0;
    end

  // A register as a clock: rises when a row begins.
  reg row_clock;
  always @(posedge pixel_clock or negedge frame)
    if (!frame) row_clock <= 0;
    else row_clock <= HSYNC;

  reg first;
  reg [RW-1:0] row;
  always @(posedge row_clock or negedge frame)
    if (!frame) begin row <= 0; first <= 1; end
    else begin
      first <= 0;
      if (!first) row <= row + 1'b1;
    end

  wire full = write & column == COLUMNS - 1 & row == ROWS - 1;
  always @(posedge PIXCLK or negedge storing)
    if (!storing) ACK <= 0;
    else if (full) ACK <= 1;

  wire read_clock = DCLK & ENABLE & RNW;
  reg [CW+RW-1:0] next;
  function [CW+RW-1:0] after(input [CW+RW-1:0] at);
    after = at[CW-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[CW+RW-1:CW] != ROWS - 1 ? {at[CW+RW-1:CW] + 1'b1, {CW{1'b0}}} : 0;
  endfunction
  wire off = ~(ENABLE & RNW);
  always @(posedge read_clock or posedge off)
    if (off) next <= 0;
    else next <= after(next);
  always @(posedge read_clock or posedge off)
    if (off) DATA <= 0;
    else DATA <= SRAM_D_I;

  reg bank;
  always @(posedge ENABLE) bank <= BANK;
  assign SRAM_A = {bank, RNW ? next : {row, column}};
  assign SRAM_D_O = pixel;
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~(ENABLE & RNW);
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
