// No frame buffer: every style of clocking, shown on the outputs.
module clock_styles #(parameter COLUMNS = 1024, parameter ROWS = 512) (
  input PIXCLK, input [7:0] PIXDATA, input HSYNC, input VSYNC,
  input ENABLE, input RNW, input BANK, input DCLK,
  output ACK, output [7:0] DATA,
  output [$clog2(COLUMNS)+$clog2(ROWS):0] SRAM_A,
  input [7:0] SRAM_D_I, output [7:0] SRAM_D_O, output SRAM_D_OE,
  output SRAM_CE_N, output SRAM_OE_N, output SRAM_WE_N
);
  // A ripple counter: each bit clocks the next.
  reg [3:0] ripple = 0;
  always @(posedge PIXCLK) ripple[0] <= ~ripple[0];
  always @(negedge ripple[0]) ripple[1] <= ~ripple[1];
  always @(negedge ripple[1]) ripple[2] <= ~ripple[2];
  always @(negedge ripple[2]) ripple[3] <= ~ripple[3];

  // Data that changes with the register that clocks it on.
  reg toggle = 0;
  reg [7:0] first = 0, second = 0;
  always @(posedge PIXCLK) begin toggle <= ~toggle; first <= PIXDATA; end
  always @(posedge toggle) second <= first;

  // A clock gate of a latch and an AND, and a gated clock of that one.
  reg open = 0;
  always @* if (!PIXCLK) open = HSYNC;
  wire gated = PIXCLK & open;
  wire twice = gated & BANK;
  reg [2:0] slow = 0, slower = 0;
  always @(posedge gated) slow <= slow + 1'b1;
  always @(posedge twice or negedge VSYNC)
    if (!VSYNC) slower <= 0; else slower <= slower + slow;

  // A clock from either of two pins, by a register that one of them clocks.
  reg chosen = 0;
  wire either = chosen ? DCLK : PIXCLK;
  reg [3:0] chances = 0;
  always @(negedge DCLK) chosen <= ENABLE;
  always @(posedge either) chances <= chances + 1'b1;

  // Set and reset from registers.
  reg [1:0] phase = 0;
  always @(negedge DCLK) phase <= phase + 1'b1;
  wire set = phase == 1, clear = phase == 3;
  reg flag = 0;
  always @(posedge DCLK or posedge clear or posedge set)
    if (clear) flag <= 0; else if (set) flag <= 1; else flag <= ~flag;

  // A memory with two clocks, written at a falling edge of logic, read without a clock.
  reg [3:0] cells [0:15];
  wire write_clock = PIXCLK ^ RNW;
  always @(negedge write_clock) if (VSYNC) cells[PIXDATA[3:0]] <= PIXDATA[7:4] ^ slow;
  reg [3:0] fetched = 0;
  always @(posedge DCLK) fetched <= cells[ripple];
  integer n;
  initial for (n = 0; n < 16; n = n + 1) cells[n] = n;

  // A carry through one vector, bit by bit.
  wire [4:0] carry;
  assign carry[0] = BANK;
  assign carry[4:1] = carry[3:0] & PIXDATA[3:0];

  // From the memory's data to a pin without a register.
  wire [7:0] passed = ENABLE ? SRAM_D_I : second;
  assign DATA = passed ^ {chances, fetched};
  assign ACK = flag;
  assign SRAM_A = {slower, ripple, cells[slow], carry[4], slow};
  assign SRAM_D_O = second;
  assign SRAM_D_OE = gated;
  assign SRAM_CE_N = ~ENABLE;
  assign SRAM_OE_N = ~RNW | gated;
  assign SRAM_WE_N = ~(gated & ~RNW);
endmodule
