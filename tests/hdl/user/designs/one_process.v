// One process for the camera's side, one for the microcontroller's, all state in them.
module one_process #(parameter COLUMNS = 1024, parameter ROWS = 512) (
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

  reg [CW-1:0] column;
  reg [RW-1:0] row;
  reg [7:0] pixel;
  reg write, synced, in_line, full, done;

  always @(posedge PIXCLK or negedge storing)
    if (!storing) begin
      column <= 0; row <= 0; pixel <= 0;
      write <= 0; synced <= 0; in_line <= 0; full <= 0; done <= 0;
    end else begin
      pixel <= PIXDATA;
      write <= 0;
      if (!VSYNC) begin
        synced <= ~HSYNC; in_line <= 0; full <= 0; column <= 0; row <= 0;
      end else begin
        if (write) begin
          if (column == COLUMNS - 1) begin
            full <= 1; column <= 0;
            if (row == ROWS - 1) begin done <= 1; row <= 0; end
            else row <= row + 1'b1;
          end else column <= column + 1'b1;
        end
        if (!HSYNC) begin
          synced <= 1;
          full <= 0;
          in_line <= 0;
          if (in_line && !full && !(write && column == COLUMNS - 1)) begin
            column <= 0; row <= row + 1'b1;
          end
        end else if (synced && !full && !done && !(write && column == COLUMNS - 1)) begin
          write <= 1; in_line <= 1;
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
    else begin DATA <= SRAM_D_I; next <= after(next); end

  reg bank;
  always @(posedge ENABLE) bank <= BANK;

  assign ACK = done;
  assign SRAM_A = {bank, RNW ? next : {row, column}};
  assign SRAM_D_O = pixel;
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
