// CubeSense's board once more, in Verilog: two cameras, two SRAMs and a microcontroller around the
// generated pair of FPGAs. Reads and writes files in the folder where it runs:
//   sun.hex, nadir.hex     one byte for each active column of every line of that camera
//   sun.txt, nadir.txt     "numerator denominator line_clocks active_columns", the first two being
//                          the pixel clock's period in ps; then "start clocks rows" for each segment
//   commands.txt           "time command value" for the microcontroller, see below
//   sun_memory.hex, nadir_memory.hex, data.hex, ack.txt   what became of it
`timescale 1ps / 1ps

module camera (output reg PCLK, output reg HREF, output reg [7:0] Y);
  parameter TEXT = "", HEX = "";
  parameter PIXELS = 32;

  // Edge k of a segment is at floor(start + k * period / 2).
  reg [7:0] pixels[0:PIXELS - 1];
  reg [63:0] start, edges, numerator, denominator;
  integer segments, clocks, rows, n, pixel = 0, line_clocks, active_columns;
  task wait_for_edge;
    begin
      // The first one may be at time 0, when no pin is driven yet.
      if (start + edges * numerator / (2 * denominator) > $time)
        #(start + edges * numerator / (2 * denominator) - $time);
      edges = edges + 1;
    end
  endtask
  // Unknown until time 1, since Icarus computes nothing from pins that never change.
  initial begin
    #1{PCLK, HREF, Y} = 0;
    $readmemh(HEX, pixels);
    segments = $fopen(TEXT, "r");
    n = $fscanf(segments, "%d %d %d %d", numerator, denominator, line_clocks, active_columns);
    while ($fscanf(segments, "%d %d %d", start, clocks, rows) == 3) begin
      edges = 0;
      for (n = 0; n < clocks; n = n + 1) begin
        // Still the instant of the last falling edge.
        HREF = rows != 0 && n % line_clocks < active_columns;
        Y = 0;
        if (HREF) begin
          Y = pixels[pixel];
          pixel = pixel + 1;
        end
        wait_for_edge;
        PCLK = 1;
        wait_for_edge;
        PCLK = 0;
      end
    end
    {HREF, Y} = 0;
  end
endmodule

// Written at the end of the pulse, with what stood there just before.
module sram (input [ADDRESS_WIDTH-1:0] A, output [7:0] D_I, input [7:0] D_O,
             input D_OE, CE_N, OE_N, WE_N, powered);
  parameter ADDRESS_WIDTH = 6;
  reg [7:0] memory[0:(1 << ADDRESS_WIDTH) - 1];
  reg [ADDRESS_WIDTH-1:0] address_before = 0;
  reg [7:0] data_before = 0;
  wire write_n = CE_N | WE_N;
  wire read = ~CE_N & ~OE_N & WE_N;
  assign D_I = !powered ? 8'h00 : read ? memory[A] : D_OE ? D_O : 8'h00;
  always @(A) address_before <= #1 A;
  always @(D_O) data_before <= #1 D_O;
  always @(posedge write_n) if (powered) memory[address_before] <= data_before;
  integer address;
  initial for (address = 0; address < 1 << ADDRESS_WIDTH; address = address + 1) memory[address] = 0;
endmodule

module pair_bench;
  parameter ADDRESS_WIDTH = 6;
  parameter PIXELS = 32;
  parameter STROBE_HALF = 500000;  // half a period of CLK in ps

  reg SHIFT, EDGE, RNW, SUNEN, NADEN, CLK, sun_powered, nadir_powered;
  wire SUNACK, NADACK, DATA_OE, SUN_PCLK, SUN_HREF, NAD_PCLK, NAD_HREF;
  wire [7:0] DATA, SUN_Y, NAD_Y, sun_d_i, sun_d_o, nad_d_i, nad_d_o;
  wire [3:0] CONTENTION;
  wire [ADDRESS_WIDTH-1:0] sun_a, nad_a;
  wire sun_d_oe, sun_ce_n, sun_oe_n, sun_we_n, nad_d_oe, nad_ce_n, nad_oe_n, nad_we_n;

  camera #(.TEXT("sun.txt"), .HEX("sun.hex"), .PIXELS(PIXELS))
      sun_camera (SUN_PCLK, SUN_HREF, SUN_Y);
  camera #(.TEXT("nadir.txt"), .HEX("nadir.hex"), .PIXELS(PIXELS))
      nadir_camera (NAD_PCLK, NAD_HREF, NAD_Y);
  sram #(ADDRESS_WIDTH) sun_sram (
      sun_a, sun_d_i, sun_d_o, sun_d_oe, sun_ce_n, sun_oe_n, sun_we_n, sun_powered);
  sram #(ADDRESS_WIDTH) nadir_sram (
      nad_a, nad_d_i, nad_d_o, nad_d_oe, nad_ce_n, nad_oe_n, nad_we_n, nadir_powered);

  top dut (
      .SUN_Y(SUN_Y), .SUN_HREF(SUN_HREF), .SUN_PCLK(SUN_PCLK),
      .NAD_Y(NAD_Y), .NAD_HREF(NAD_HREF), .NAD_PCLK(NAD_PCLK),
      .SHIFT(SHIFT), .EDGE(EDGE), .RNW(RNW), .SUNEN(SUNEN), .NADEN(NADEN), .CLK(CLK),
      .SUNACK(SUNACK), .NADACK(NADACK), .DATA(DATA), .DATA_OE(DATA_OE), .CONTENTION(CONTENTION),
      .SUN_SRAM_A(sun_a), .SUN_SRAM_D_I(sun_d_i), .SUN_SRAM_D_O(sun_d_o),
      .SUN_SRAM_D_OE(sun_d_oe), .SUN_SRAM_CE_N(sun_ce_n), .SUN_SRAM_OE_N(sun_oe_n),
      .SUN_SRAM_WE_N(sun_we_n),
      .NAD_SRAM_A(nad_a), .NAD_SRAM_D_I(nad_d_i), .NAD_SRAM_D_O(nad_d_o),
      .NAD_SRAM_D_OE(nad_d_oe), .NAD_SRAM_CE_N(nad_ce_n), .NAD_SRAM_OE_N(nad_oe_n),
      .NAD_SRAM_WE_N(nad_we_n)
  );

  // The microcontroller, and the switches of the memories' supplies.
  integer commands, data, ack, command, value;
  reg [63:0] at;
  initial begin
    #1{SUNEN, NADEN, sun_powered, nadir_powered} = 4'b1111;
    {SHIFT, EDGE, RNW, CLK} = 0;
    commands = $fopen("commands.txt", "r");
    data = $fopen("data.hex", "w");
    ack = $fopen("ack.txt", "w");
    while ($fscanf(commands, "%d %d %d", at, command, value) == 3) begin
      #(at - $time);
      case (command)
        0: SHIFT = value;
        1: EDGE = value;
        2: RNW = value;
        3: SUNEN = value;
        4: NADEN = value;
        5: sun_powered = value;
        6: nadir_powered = value;
        7:
        repeat (value) begin
          CLK = 1;
          #(STROBE_HALF);
          $fdisplay(data, "%02x", DATA);
          CLK = 0;
          #(STROBE_HALF);
        end
      endcase
    end
    $writememh("sun_memory.hex", sun_sram.memory);
    $writememh("nadir_memory.hex", nadir_sram.memory);
    $finish;
  end
  always @(SUNACK) if (SUNACK === 1) $fdisplay(ack, "%0d 0", $time);
  always @(NADACK) if (NADACK === 1) $fdisplay(ack, "%0d 1", $time);
endmodule
