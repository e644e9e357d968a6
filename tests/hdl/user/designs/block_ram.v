// A row of pixels in a memory that a tool maps to block RAM: written in one clock, read in the next.
module block_ram #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output ACK, output reg [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  localparam CW = $clog2(COLUMNS), RW = $clog2(ROWS);
  wire storing = ENABLE & ~RNW;
  wire reading = ENABLE & RNW;

  reg [CW:0] fill;  // pixels of this row in the buffer
  reg ready;
  wire take = HSYNC & VSYNC & ready & fill < COLUMNS;
  always @(posedge PIXCLK or negedge storing)
    if (!storing) begin fill <= 0; ready <= 0; end
    else begin
      if (!HSYNC) ready <= 1; else if (!VSYNC) ready <= 0;
      if (!HSYNC || !VSYNC) fill <= 0; else if (take) fill <= fill + 1'b1;
    end

  reg [CW-1:0] column;
  reg [RW-1:0] row;
  reg [7:0] line_buffer [0:COLUMNS-1];
  reg [7:0] pixel;
  always @(posedge PIXCLK) begin
    if (take) line_buffer[fill[CW-1:0]] <= PIXDATA;
    pixel <= line_buffer[fetch];
  end

  // One clock later the pixel is read, and one after that it is written to the SRAM.
  reg [CW-1:0] fetch;
  reg fetched, store, done, started;
  wire last = store && column == COLUMNS - 1;
  always @(posedge PIXCLK or negedge storing)
    if (!storing) begin
      fetch <= 0; fetched <= 0; store <= 0; column <= 0; row <= 0; done <= 0; started <= 0;
    end else begin
      fetched <= take;
      fetch <= fill[CW-1:0];
      store <= fetched & ~done & VSYNC;
      column <= fetch;
      if (last && row == ROWS - 1) done <= 1;
      if (!VSYNC) begin row <= 0; started <= 0; end
      else begin
        if (fetched && fetch == 0) begin
          started <= 1;
          if (started) row <= row + 1'b1;
        end
      end
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
  wire write = store & ~done;
  assign ACK = done;
  assign SRAM_A = {bank, RNW ? next : {row, column}};
  assign SRAM_D_O = pixel;
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
