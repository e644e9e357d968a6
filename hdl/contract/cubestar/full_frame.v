// One frame of full size around the board's top: camera, SRAM and data clock in Verilog, because
// Python would need minutes for them. cocotb drives ENABLE, RNW, BANK and the requests, and
// judges the counts.
//
// A pixel's value is a hash of frame, row and column, so source and checkers share no state.
module full_frame;
    parameter COLUMNS = 1024;
    parameter ROWS = 512;
    // Least number of clocks between two rows; from 8 on VSYNC falls and rises apart from HSYNC.
    parameter PAUSE = 1;
    parameter HIGH_WRITES = 0;  // a write pulse may begin while PIXCLK is high
    localparam PIXELS = COLUMNS * ROWS;
    localparam COLUMN_BITS = $clog2(COLUMNS);
    localparam POSITION_BITS = COLUMN_BITS + $clog2(ROWS);

    // Unknown at first, so that there is an edge into standby: it resets without initial values.
    reg ENABLE = 1'bx, RNW = 1'bx;
    initial #1 begin ENABLE = 0; RNW = 0; end
    reg BANK = 0, PIXCLK = 0, HSYNC = 0, VSYNC = 0, DCLK = 0;
    reg [7:0] PIXDATA = 0;
    wire ACK, SRAM_D_OE, SRAM_CE_N, SRAM_OE_N, SRAM_WE_N;
    wire [7:0] DATA, SRAM_D_O;
    wire [POSITION_BITS:0] SRAM_A;

    // The one data bus: the FPGA's pads and the SRAM on the same wires.
    wire [7:0] bus;
    reg [7:0] memory [0:2 * (1 << POSITION_BITS) - 1];
    assign bus = SRAM_D_OE ? SRAM_D_O : 8'bz;
    assign bus = (SRAM_CE_N | SRAM_OE_N | ~SRAM_WE_N) ? 8'bz : memory[SRAM_A];

    dut dut (
        .PIXCLK(PIXCLK), .PIXDATA(PIXDATA), .HSYNC(HSYNC), .VSYNC(VSYNC),
        .ENABLE(ENABLE), .RNW(RNW), .BANK(BANK), .DCLK(DCLK), .ACK(ACK), .DATA(DATA),
        .SRAM_A(SRAM_A), .SRAM_D_I(bus), .SRAM_D_O(SRAM_D_O), .SRAM_D_OE(SRAM_D_OE),
        .SRAM_CE_N(SRAM_CE_N), .SRAM_OE_N(SRAM_OE_N), .SRAM_WE_N(SRAM_WE_N)
    );

    function [7:0] pixel(input integer frame, input integer row, input integer column);
        reg [31:0] mixed;
        begin
            mixed = {frame[7:0], row[9:0], column[13:0]} * 32'h9E3779B1;
            pixel = mixed[31:24] ^ mixed[23:16];
        end
    endfunction

    // Camera: free-running, joined in the last rows of frame 0. One clock in 256 is stretched.
    integer seed, half, frame, row, column, blank, paused, stretch;
    initial begin
        if (!$value$plusargs("seed=%d", seed)) seed = 1;
        half = 30000 + $unsigned($random(seed)) % 40000;
        frame = 0;
        row = ROWS - 96 + $unsigned($random(seed)) % 64;
        column = $unsigned($random(seed)) % COLUMNS;
        blank = 0;
        paused = 0;
        forever begin
            stretch = $random(seed);
            #(half + (stretch[7:0] == 0 ? stretch[19:8] * 100 : 0)) PIXCLK = 1;
            #(half / 4) if (blank > 0) begin
                blank = blank - 1;
                HSYNC = 0;
                VSYNC = row != 0 || (PAUSE >= 8 && (paused < 3 || blank < 2));
                paused = paused + 1;
                PIXDATA = stretch[31:24];
            end else begin
                HSYNC = 1;
                VSYNC = 1;
                PIXDATA = pixel(frame, row, column);
                column = column + 1;
                if (column == COLUMNS) begin
                    column = 0;
                    paused = 0;
                    blank = PAUSE + $unsigned($random(seed)) % 20;
                    row = row + 1;
                    if (row == ROWS) begin
                        row = 0;
                        frame = frame + 1;
                    end
                end
            end
            #(half - half / 4) PIXCLK = 0;
        end
    end

    // SRAM. A frame's pulses are counted from its VSYNC on, and its addresses go with the count.
    integer pulses = 0, disorder = 0, unstable = 0, contention = 0;
    time pulse_end = 0;
    reg bank_wanted = 0;
    always @(posedge VSYNC) if (!ACK) pulses = 0;
    always @(negedge SRAM_WE_N) if (!HIGH_WRITES && PIXCLK !== 0) unstable = unstable + 1;
    // What the pins have settled at a picosecond after a change; a pulse may end with it.
    reg [POSITION_BITS:0] written_at;
    reg [7:0] written;
    time pulse_start = 0;
    always @(negedge SRAM_WE_N) pulse_start = $time;
    always @(SRAM_A or bus or SRAM_WE_N) #1 if (SRAM_WE_N === 0 && SRAM_CE_N === 0) begin
        if ($time - 1 > pulse_start && {written_at, written} !== {SRAM_A, bus})
            unstable = unstable + 1;
        written_at = SRAM_A;
        written = bus;
    end
    always @(posedge SRAM_WE_N) if (SRAM_CE_N === 0) begin
        memory[written_at] = written;
        if (written_at !== {bank_wanted, pulses[POSITION_BITS - 1:0]}) disorder = disorder + 1;
        pulses = pulses + 1;
        pulse_end = $time;
    end
    always @(SRAM_D_OE or SRAM_OE_N) #1 if (SRAM_D_OE && !SRAM_OE_N) contention = contention + 1;

    integer ack_pulses = 0, ack_frame = 0;
    time ack_delay = 0;
    always @(posedge ACK) begin
        ack_pulses = pulses;
        ack_delay = $time - pulse_end;
        ack_frame = frame;
    end

    // Requests: compare the bank with frame `expected`, in the memory or through the data clock.
    reg look = 0, read = 0, read_done = 0;
    integer expected = 0, wrong_in_memory = -1, wrong_in_data = -1, step, index;
    always @(posedge look) begin
        wrong_in_memory = 0;
        for (index = 0; index < PIXELS; index = index + 1)
            if (memory[bank_wanted * PIXELS + index] !== pixel(expected, index / COLUMNS, index % COLUMNS))
                wrong_in_memory = wrong_in_memory + 1;
    end
    always @(posedge read) begin
        wrong_in_data = 0;
        for (step = 0; step < PIXELS + COLUMNS; step = step + 1) begin
            index = step % PIXELS;
            #331007 DCLK = 1;
            #100003 if (DATA !== pixel(expected, index / COLUMNS, index % COLUMNS))
                wrong_in_data = wrong_in_data + 1;
            DCLK = 0;
        end
        read_done = 1;
    end
endmodule
