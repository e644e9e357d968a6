// Synchronous resets on the camera's clock, released through two flip-flops.
module synchronous_reset #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output ACK, output reg [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output reg [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  wire storing = ENABLE & ~RNW;
  reg [1:0] on;
  always @(posedge PIXCLK or negedge storing)
    if (!storing) on <= 0; else on <= {on[0], 1'b1};
  wire rst = ~on[1];

  reg [CW:0] column;
  reg [RW:0] row;
  reg store, ready;
  wire last = store && column == COLUMNS - 1;
  always @(posedge PIXCLK) begin
    SRAM_D_O <= PIXDATA;
    if (rst || !VSYNC) begin
      store <= 0; column <= 0; row <= 0;
      ready <= ~rst & ~HSYNC;
    end else if (!HSYNC) begin
      store <= 0; column <= 0; ready <= 1;
      if (store || column != 0) row <= row + 1'b1;
    end else begin
      store <= ready && !last && column < COLUMNS && row < ROWS;
      if (store) column <= column + 1'b1;
    end
    if (rst) done <= 0;
    else if (last && row == ROWS - 1) done <= 1;
    if (rst) SRAM_D_O <= 0;
  end
  reg done;

  wire reading = ENABLE & RNW;
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
  wire write = store & storing & ~done;
  assign ACK = done & storing;
  assign SRAM_A = {bank, RNW ? next : {row[RW-1:0], column[CW-1:0]}};
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
