// Pixels are sampled at the rising edge; all that leads to the memory moves at the falling one.
module negative_edge #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output reg ACK, output reg [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  wire storing = ENABLE & ~RNW;
  wire reading = ENABLE & RNW;

  reg [7:0] pixel;
  reg line, frame;
  always @(posedge PIXCLK or negedge storing)
    if (!storing) begin pixel <= 0; line <= 0; frame <= 0; end
    else begin pixel <= PIXDATA; line <= HSYNC; frame <= VSYNC; end

  reg [CW-1:0] column;
  reg [RW-1:0] row;
  reg [7:0] shown;
  reg write, armed, full;
  wire last = write & column == COLUMNS - 1;
  always @(negedge PIXCLK or negedge storing)
    if (!storing) begin
      column <= 0; row <= 0; write <= 0; armed <= 0; full <= 0; shown <= 0; ACK <= 0;
    end else begin
      shown <= pixel;
      write <= line & frame & armed & ~full & ~last & ~ACK;
      armed <= ~line | (armed & frame);
      full <= line & (full | last);
      if (last | (write & ~line)) begin column <= 0; row <= row + 1'b1; end
      else if (write) column <= column + 1'b1;
      if (!frame) begin column <= 0; row <= 0; end
      if (last & row == ROWS - 1) ACK <= 1;
    end

  reg [CW+RW-1:0] next;
  function [CW+RW-1:0] after(input [CW+RW-1:0] at);
    after = at[CW-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[CW+RW-1:CW] != ROWS - 1 ? {at[CW+RW-1:CW] + 1'b1, {CW{1'b0}}} : 0;
  endfunction
  always @(posedge DCLK or negedge reading)
    if (!reading) DATA <= 0;
    else DATA <= SRAM_D_I;
  always @(negedge DCLK or negedge reading)
    if (!reading) next <= 0;
    else next <= after(next);

  reg bank;
  always @(posedge ENABLE) bank <= BANK;
  assign SRAM_A = {bank, RNW ? next : {row, column}};
  assign SRAM_D_O = shown;
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~(write & PIXCLK);
endmodule
