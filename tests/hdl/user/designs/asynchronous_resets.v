// Flip-flops with an asynchronous set and reset at once, and resets from other registers.
module asynchronous_resets #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output reg ACK, output reg [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  wire stop = ~(ENABLE & ~RNW);
  reg [1:0] held;  // in reset until the second clock
  always @(posedge PIXCLK or posedge stop)
    if (stop) held <= 2'b11; else held <= {held[0], 1'b0};
  wire reset = held[1];

  // Set by the gap between two rows, reset by the one between two frames.
  reg ready, settable;
  wire clear = reset | ~VSYNC;
  always @(posedge PIXCLK or posedge clear)
    if (clear) settable <= 0; else settable <= 1;
  wire gap = ~HSYNC & settable;
  always @(posedge PIXCLK or posedge clear or posedge gap)
    if (clear) ready <= 0;
    else if (gap) ready <= 1;

  wire row_over = ~HSYNC | reset;
  reg [CW:0] column;
  reg write;
  reg [7:0] pixel;
  wire accept = ready & VSYNC & HSYNC & ~ACK & ~(column == COLUMNS) &
                ~(write & column == COLUMNS - 1);
  always @(posedge PIXCLK or posedge reset)
    if (reset) begin write <= 0; pixel <= 0; column <= 0; end
    else begin
      write <= accept;
      pixel <= PIXDATA;
      if (row_over | ~VSYNC) column <= 0;
      else if (write) column <= column + 1'b1;
    end

  reg [RW-1:0] row;
  wire frame_over = ~VSYNC | reset;
  wire row_stored = ~HSYNC & (write | column != 0);
  always @(posedge PIXCLK or posedge frame_over)
    if (frame_over) row <= 0;
    else if (row_stored) row <= row + 1'b1;

  always @(posedge PIXCLK or posedge reset)
    if (reset) ACK <= 0;
    else if (write && column == COLUMNS - 1 && row == ROWS - 1) ACK <= 1;

  wire off = ~(ENABLE & RNW);
  reg [CW+RW-1:0] next;
  function [CW+RW-1:0] after(input [CW+RW-1:0] at);
    after = at[CW-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[CW+RW-1:CW] != ROWS - 1 ? {at[CW+RW-1:CW] + 1'b1, {CW{1'b0}}} : 0;
  endfunction
  always @(posedge DCLK or posedge off)
    if (off) begin next <= 0; DATA <= 0; end
    else begin next <= after(next); DATA <= SRAM_D_I; end

  reg bank;
  always @(posedge ENABLE) bank <= BANK;
  assign SRAM_A = {bank, RNW ? next : {row, column[CW-1:0]}};
  assign SRAM_D_O = pixel;
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = off;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
