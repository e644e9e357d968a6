// The board of the compiled engine once more, in Verilog: camera, SRAM and microcontroller around
// the generated top. Reads and writes files in the folder where it runs:
//   pixels.hex     one byte for each active column of every line
//   segments.txt   "start clocks rows vsync" for each segment of the camera's stream
//   commands.txt   "time command value" for the microcontroller, see below
//   sram.hex, data.hex, ack.txt   what became of it
`timescale 1ps / 1ps

module bench;
  parameter ADDRESS_WIDTH = 6;
  parameter LINE_CLOCKS = 12;
  parameter ACTIVE_COLUMNS = 8;
  parameter PIXELS = 32;
  parameter PIXEL_NUMERATOR = 100000;  // period of PIXCLK in ps, as a fraction
  parameter PIXEL_DENOMINATOR = 1;
  parameter STROBE_HALF = 500000;  // half a period of DCLK in ps

  reg PIXCLK = 0, HSYNC = 0, VSYNC = 0, ENABLE = 0, RNW = 0, BANK = 0, DCLK = 0;
  reg [7:0] PIXDATA = 0;
  wire ACK, SRAM_D_OE, SRAM_CE_N, SRAM_OE_N, SRAM_WE_N;
  wire [7:0] DATA, SRAM_D_O;
  wire [ADDRESS_WIDTH-1:0] SRAM_A;

  // The memory: written at the end of the pulse, with what stood there just before.
  reg [7:0] memory[0:(1 << ADDRESS_WIDTH) - 1];
  reg [ADDRESS_WIDTH-1:0] address_before = 0;
  reg [7:0] data_before = 0;
  wire write_n = SRAM_CE_N | SRAM_WE_N;
  wire read = ~SRAM_CE_N & ~SRAM_OE_N & SRAM_WE_N;
  wire [7:0] SRAM_D_I = read ? memory[SRAM_A] : SRAM_D_OE ? SRAM_D_O : 8'h00;
  always @(SRAM_A) address_before <= #1 SRAM_A;
  always @(SRAM_D_O) data_before <= #1 SRAM_D_O;
  always @(posedge write_n) memory[address_before] <= data_before;

  top dut (
      .PIXCLK(PIXCLK), .PIXDATA(PIXDATA), .HSYNC(HSYNC), .VSYNC(VSYNC), .ENABLE(ENABLE),
      .RNW(RNW), .BANK(BANK), .DCLK(DCLK), .ACK(ACK), .DATA(DATA), .SRAM_A(SRAM_A),
      .SRAM_D_I(SRAM_D_I), .SRAM_D_O(SRAM_D_O), .SRAM_D_OE(SRAM_D_OE), .SRAM_CE_N(SRAM_CE_N),
      .SRAM_OE_N(SRAM_OE_N), .SRAM_WE_N(SRAM_WE_N)
  );

  // The camera. Edge k of a segment is at floor(start + k * period / 2).
  reg [7:0] pixels[0:PIXELS - 1];
  integer segments, clocks, rows, vsync, n, pixel = 0;
  reg [63:0] start, edges;
  task wait_for_edge;
    begin
      #(start + edges * PIXEL_NUMERATOR / (2 * PIXEL_DENOMINATOR) - $time);
      edges = edges + 1;
    end
  endtask
  initial begin
    $readmemh("pixels.hex", pixels);
    segments = $fopen("segments.txt", "r");
    while ($fscanf(segments, "%d %d %d %d", start, clocks, rows, vsync) == 4) begin
      edges = 0;
      for (n = 0; n < clocks; n = n + 1) begin
        // Still the instant of the last falling edge.
        VSYNC = vsync;
        HSYNC = rows != 0 && n % LINE_CLOCKS < ACTIVE_COLUMNS;
        PIXDATA = 0;
        if (HSYNC) begin
          PIXDATA = pixels[pixel];
          pixel = pixel + 1;
        end
        wait_for_edge;
        PIXCLK = 1;
        wait_for_edge;
        PIXCLK = 0;
      end
    end
    {VSYNC, HSYNC, PIXDATA} = 0;
  end

  // The microcontroller.
  integer commands, data, ack, command, value;
  reg [63:0] at;
  integer address;
  initial begin
    for (address = 0; address < 1 << ADDRESS_WIDTH; address = address + 1) memory[address] = 0;
    commands = $fopen("commands.txt", "r");
    data = $fopen("data.hex", "w");
    ack = $fopen("ack.txt", "w");
    while ($fscanf(commands, "%d %d %d", at, command, value) == 3) begin
      #(at - $time);
      case (command)
        0: ENABLE = value;
        1: RNW = value;
        2: BANK = value;
        3:
        repeat (value) begin
          DCLK = 1;
          #(STROBE_HALF);
          $fdisplay(data, "%02x", DATA);
          DCLK = 0;
          #(STROBE_HALF);
        end
      endcase
    end
    $writememh("sram.hex", memory);
    $finish;
  end
  always @(ACK) if (ACK === 1) $fdisplay(ack, "%0d", $time);
endmodule
