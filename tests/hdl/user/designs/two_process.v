// A state machine in two processes: a register, and the logic that chooses its next state.
module two_process #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input wire PIXCLK, input wire [7:0] PIXDATA, input wire HSYNC, input wire VSYNC,
  input wire ENABLE, input wire RNW, input wire BANK, input wire DCLK,
  output wire ACK, output wire [7:0] DATA,
  output wire [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input wire [7:0] SRAM_D_I, output wire [7:0] SRAM_D_O, output wire SRAM_D_OE,
  output wire SRAM_CE_N, output wire SRAM_OE_N, output wire SRAM_WE_N
);
  wire reset = ~ENABLE | RNW;
  wire ack, store;
  wire [7:0] pixel;
  wire [$clog2(COLUMNS)+$clog2(ROWS)-1:0] write_address, read_address;
  camera_side #(COLUMNS, ROWS) writer (
    PIXCLK, reset, PIXDATA, HSYNC, VSYNC, ack, store, pixel, write_address);
  host_side #(COLUMNS, ROWS) reader (DCLK, ENABLE & RNW, SRAM_D_I, DATA,
    read_address);
  reg bank;
  always @(posedge ENABLE) bank <= BANK;
  assign ACK = ack;
  assign SRAM_A = {bank, RNW ? read_address : write_address};
  assign SRAM_D_O = pixel;
  assign SRAM_D_OE = store;
  assign SRAM_CE_N = !ENABLE;
  assign SRAM_OE_N = !(ENABLE && RNW);
  assign SRAM_WE_N = !(store && !PIXCLK);
endmodule

module camera_side #(parameter COLUMNS = 4, parameter ROWS = 2) (
  input wire clk, input wire reset, input wire [7:0] d, input wire line, input wire frame,
  output wire ack, output wire store, output reg [7:0] pixel,
  output wire [$clog2(COLUMNS)+$clog2(ROWS)-1:0] address
);
  localparam [2:0] SYNC = 0, GAP = 1, PIXEL = 2, REST = 3, DONE = 4;
  reg [2:0] state, next_state;
  reg [$clog2(COLUMNS)-1:0] column, next_column;
  reg [$clog2(ROWS)-1:0] row, next_row;
  wire last_column = column == COLUMNS - 1;

  always @* begin
    next_state = state;
    next_column = column;
    next_row = row;
    case (state)
      SYNC: if (!line) next_state = GAP;
      GAP: if (line) next_state = PIXEL;
      PIXEL: begin
        next_column = column + 1;
        if (last_column || !line) begin
          next_state = line ? REST : GAP;
          next_column = 0;
          next_row = row + 1;
          if (last_column && row == ROWS - 1) next_state = DONE;
        end
      end
      REST: if (!line) next_state = GAP;
      DONE: ;
      default: next_state = SYNC;
    endcase
    if (!frame && state != DONE) begin
      next_state = line ? SYNC : GAP;
      next_column = 0;
      next_row = 0;
    end
  end

  always @(posedge clk or posedge reset)
    if (reset) begin
      state <= SYNC; column <= 0; row <= 0; pixel <= 0;
    end else begin
      state <= next_state; column <= next_column; row <= next_row; pixel <= d;
    end

  assign ack = state == DONE;
  assign store = state == PIXEL;
  assign address = {row, column};
endmodule

module host_side #(parameter COLUMNS = 4, parameter ROWS = 2) (
  input wire clk, input wire on, input wire [7:0] memory, output reg [7:0] data,
  output reg [$clog2(COLUMNS)+$clog2(ROWS)-1:0] address
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  function [CW+RW-1:0] after(input [CW+RW-1:0] at);
    after = at[CW-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[CW+RW-1:CW] != ROWS - 1 ? {at[CW+RW-1:CW] + 1'b1, {CW{1'b0}}} : 0;
  endfunction
  always @(posedge clk or negedge on)
    if (!on) {data, address} <= 0;
    else begin data <= memory; address <= after(address); end
endmodule
