// A branch without "else": the data to write is a latch, by mistake, but holds the right byte.
module latch #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output ACK, output reg [7:0] DATA,
  output reg [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output reg [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  wire storing = ENABLE & ~RNW;
  wire reading = ENABLE & RNW;
  reg [CW-1:0] column;
  reg [RW-1:0] row;
  reg [7:0] pixel;
  reg write, armed, full, done;
  wire last = write & column == COLUMNS - 1;
  always @(posedge PIXCLK or negedge storing)
    if (!storing) begin
      column <= 0; row <= 0; pixel <= 0; write <= 0; armed <= 0; full <= 0; done <= 0;
    end else begin
      pixel <= PIXDATA;
      write <= HSYNC & VSYNC & armed & ~full & ~last & ~done;
      armed <= ~HSYNC | (armed & VSYNC);
      full <= HSYNC & (full | last);
      if (last) column <= 0; else if (write) column <= HSYNC ? column + 1'b1 : 0;
      if (last | (write & ~HSYNC)) row <= row + 1'b1;
      if (!VSYNC) begin column <= 0; row <= 0; end
      if (last & row == ROWS - 1) done <= 1;
    end

  reg [CW+RW-1:0] next;
  function [CW+RW-1:0] after(input [CW+RW-1:0] at);
    after = at[CW-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[CW+RW-1:CW] != ROWS - 1 ? {at[CW+RW-1:CW] + 1'b1, {CW{1'b0}}} : 0;
  endfunction
  always @(posedge DCLK or negedge reading)
    if (!reading) begin next <= 0; DATA <= 0; end
    else begin next <= after(next); DATA <= SRAM_D_I; end

  reg bank;
  always @(posedge ENABLE) bank <= BANK;
  always @* begin
    if (write) SRAM_D_O = pixel;  // no else
    SRAM_A = {bank, RNW ? next : {row, column}};
  end
  assign ACK = done;
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
