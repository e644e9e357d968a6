// SystemVerilog: sizes by parameters, an included file, an enumeration, initial values from a file.
`include "sizes.svh"
module parameters #(
  parameter int COLUMNS = 1024, parameter int ROWS = 512, parameter bit SYNCHRONISE = 1,
  parameter STEPS = "steps.hex"
) (
  input logic PIXCLK, input logic [7:0] PIXDATA, input logic HSYNC, input logic VSYNC,
  input logic ENABLE, input logic RNW, input logic BANK, input logic DCLK,
  output logic ACK, output logic [7:0] DATA,
  output logic [`ADDRESS_BITS(COLUMNS, ROWS):0] SRAM_A,
  input logic [7:0] SRAM_D_I, output logic [7:0] SRAM_D_O, output logic SRAM_D_OE,
  output logic SRAM_CE_N, output logic SRAM_OE_N, output logic SRAM_WE_N
);
  typedef enum logic [1:0] {IDLE, ARMED, FULL} line_state;
  logic storing, reading, reset, write, last, bank;
  logic [$clog2(COLUMNS)-1:0] column;
  logic [$clog2(ROWS)-1:0] row;
  logic [`ADDRESS_BITS(COLUMNS, ROWS)-1:0] next;
  line_state state;
  assign storing = ENABLE & ~RNW;
  assign reading = ENABLE & RNW;

  generate
    if (SYNCHRONISE) begin : released
      logic [1:0] stages;
      always_ff @(posedge PIXCLK or negedge storing)
        if (!storing) stages <= '0; else stages <= {stages[0], 1'b1};
      assign reset = ~stages[1];
    end else begin : at_once
      assign reset = ~storing;
    end
  endgenerate

  // How far the address steps, by whether the row goes on: a table read from a file.
  logic [3:0] steps [0:1];
  initial $readmemh(STEPS, steps);

  assign last = write & column == COLUMNS - 1;
  always_ff @(posedge PIXCLK or posedge reset)
    if (reset) begin
      column <= '0; row <= '0; SRAM_D_O <= '0; write <= '0; state <= IDLE; ACK <= '0;
    end else begin
      SRAM_D_O <= PIXDATA;
      write <= HSYNC & VSYNC & state == ARMED & ~last & ~ACK;
      unique case (state)
        FULL: if (!HSYNC) state <= ARMED;
        ARMED: if (!VSYNC & HSYNC) state <= IDLE; else if (HSYNC & last) state <= FULL;
        default: if (!HSYNC) state <= ARMED;
      endcase
      if (last | (write & ~HSYNC)) begin column <= '0; row <= row + 1'b1; end
      else column <= column + steps[write];
      if (!VSYNC) begin column <= '0; row <= '0; end
      if (last & row == ROWS - 1) ACK <= '1;
    end

  function [`ADDRESS_BITS(COLUMNS, ROWS)-1:0] after(input [`ADDRESS_BITS(COLUMNS, ROWS)-1:0] at);
    after = at[$clog2(COLUMNS)-1:0] != COLUMNS - 1 ? at + 1'b1
          : at[`ADDRESS_BITS(COLUMNS, ROWS)-1:$clog2(COLUMNS)] != ROWS - 1 ? {at[`ADDRESS_BITS(COLUMNS, ROWS)-1:$clog2(COLUMNS)] + 1'b1, {$clog2(COLUMNS){1'b0}}} : 0;
  endfunction
  always_ff @(posedge DCLK or negedge reading)
    if (!reading) begin next <= '0; DATA <= '0; end
    else begin next <= after(next); DATA <= SRAM_D_I; end

  always_ff @(posedge ENABLE) bank <= BANK;
  assign SRAM_A = {bank, RNW ? next : {row, column}};
  assign SRAM_D_OE = write;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~reading;
  assign SRAM_WE_N = ~write | PIXCLK;
endmodule
