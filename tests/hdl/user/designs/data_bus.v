// The memory's data bus as it is on the board: one inout, driven by an internal tri-state bus.
module data_bus #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output ACK, output [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  inout [7:0] SRAM_D,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam WIDTH = $clog2(COLUMNS) + $clog2(ROWS);
  wire storing = ENABLE & ~RNW;
  wire reading = ENABLE & RNW;
  wire [WIDTH-1:0] address;  // of whichever side is on
  wire [7:0] pixel;
  wire write;
  store_side #(COLUMNS, ROWS) store_side (
    .clk(PIXCLK), .on(storing), .d(PIXDATA), .line(HSYNC), .frame(VSYNC),
    .address(address), .pixel(pixel), .write(write), .ack(ACK));
  read_side #(COLUMNS, ROWS) read_side (
    .clk(DCLK), .on(reading), .storing(storing), .memory(SRAM_D), .data(DATA), .address(address));
  reg bank;
  always @(posedge ENABLE) bank <= BANK;
  assign SRAM_A = {bank, address};
  assign SRAM_D = write ? pixel : 8'bzzzz_zzzz;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule

module store_side #(parameter COLUMNS = 4, parameter ROWS = 2) (
  input clk, input on, input [7:0] d, input line, input frame,
  output [$clog2(COLUMNS)+$clog2(ROWS)-1:0] address, output reg [7:0] pixel,
  output reg write, output reg ack
);
  reg [$clog2(COLUMNS)-1:0] column;
  reg [$clog2(ROWS)-1:0] row;
  reg armed, full;
  wire last = write & column == COLUMNS - 1;
  always @(posedge clk or negedge on)
    if (!on) begin
      column <= 0; row <= 0; pixel <= 0; write <= 0; armed <= 0; full <= 0; ack <= 0;
    end else begin
      pixel <= d;
      write <= line & frame & armed & ~full & ~last & ~ack;
      armed <= ~line | (armed & frame);
      full <= line & (full | last);
      if (last | (write & ~line)) begin column <= 0; row <= row + 1'b1; end
      else if (write) column <= column + 1'b1;
      if (!frame) begin column <= 0; row <= 0; end
      if (last & row == ROWS - 1) ack <= 1;
    end
  assign address = on ? {row, column} : 'bz;
endmodule

module read_side #(parameter COLUMNS = 4, parameter ROWS = 2) (
  input clk, input on, input storing, input [7:0] memory, output reg [7:0] data,
  output [$clog2(COLUMNS)+$clog2(ROWS)-1:0] address
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  reg [CW+RW-1:0] next;
  function [CW+RW-1:0] after(input [CW+RW-1:0] at);
    after = at[CW-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[CW+RW-1:CW] != ROWS - 1 ? {at[CW+RW-1:CW] + 1'b1, {CW{1'b0}}} : 0;
  endfunction
  always @(posedge clk or negedge on)
    if (!on) begin next <= 0; data <= 0; end
    else begin next <= after(next); data <= memory; end
  assign address = storing ? 'bz : next;
endmodule
