// Full-size pictures around the pair of FPGAs: cameras, SRAMs and data clock in Verilog, because
// Python would need minutes for them. cocotb drives the control lines and the requests, and judges
// the counts.
//
// A pixel's value is a hash of camera, frame, row and column, so source and checkers share no
// state. Frame 1 of the sun camera has a Sun: three bright pixels after two that do not count.
module cubesense_full_frame;
    parameter COLUMNS = 640;
    parameter ROWS = 480;
    localparam LINE_CLOCKS = 858, LINES = 525;
    localparam SUN_X = 637, SUN_Y = 479;

    // Unknown until time 1, since Icarus computes nothing from pins that never change.
    reg SUNEN, NADEN, RNW, EDGE, SHIFT, CLK, SUN_PCLK, SUN_HREF, NAD_PCLK, NAD_HREF;
    reg [7:0] SUN_Y_, NAD_Y_;
    initial #1 begin
        {SUNEN, NADEN} = 2'b11;
        {RNW, EDGE, SHIFT, CLK, SUN_PCLK, SUN_HREF, NAD_PCLK, NAD_HREF, SUN_Y_, NAD_Y_} = 0;
    end
    wire SUNACK, NADACK, DATA_OE;
    wire [7:0] DATA;
    wire [3:0] CONTENTION;

    wire [18:0] sun_a, nadir_a;
    wire [7:0] sun_d_o, nadir_d_o, sun_bus, nadir_bus;
    wire sun_d_oe, sun_ce_n, sun_oe_n, sun_we_n, nadir_d_oe, nadir_ce_n, nadir_oe_n, nadir_we_n;
    reg [7:0] sun_memory [0:(1 << 19) - 1];
    reg [7:0] nadir_memory [0:(1 << 19) - 1];
    assign sun_bus = sun_d_oe ? sun_d_o : 8'bz;
    assign sun_bus = (sun_ce_n | sun_oe_n | ~sun_we_n) ? 8'bz : sun_memory[sun_a];
    assign nadir_bus = nadir_d_oe ? nadir_d_o : 8'bz;
    assign nadir_bus = (nadir_ce_n | nadir_oe_n | ~nadir_we_n) ? 8'bz : nadir_memory[nadir_a];

    dut dut (
        .SUN_Y(SUN_Y_), .SUN_HREF(SUN_HREF), .SUN_PCLK(SUN_PCLK),
        .NAD_Y(NAD_Y_), .NAD_HREF(NAD_HREF), .NAD_PCLK(NAD_PCLK),
        .SUNEN(SUNEN), .NADEN(NADEN), .RNW(RNW), .EDGE(EDGE), .SHIFT(SHIFT), .CLK(CLK),
        .SUNACK(SUNACK), .NADACK(NADACK), .DATA(DATA), .DATA_OE(DATA_OE), .CONTENTION(CONTENTION),
        .SUN_SRAM_A(sun_a), .SUN_SRAM_D_I(sun_bus), .SUN_SRAM_D_O(sun_d_o), .SUN_SRAM_D_OE(sun_d_oe),
        .SUN_SRAM_CE_N(sun_ce_n), .SUN_SRAM_OE_N(sun_oe_n), .SUN_SRAM_WE_N(sun_we_n),
        .NAD_SRAM_A(nadir_a), .NAD_SRAM_D_I(nadir_bus), .NAD_SRAM_D_O(nadir_d_o), .NAD_SRAM_D_OE(nadir_d_oe),
        .NAD_SRAM_CE_N(nadir_ce_n), .NAD_SRAM_OE_N(nadir_oe_n), .NAD_SRAM_WE_N(nadir_we_n)
    );

    // camera 0 is the sun's; its pixels are dark, but for the Sun.
    function [7:0] pixel(input integer camera, input integer frame, input integer row,
                         input integer column);
        reg [31:0] mixed;
        begin
            mixed = {camera[0], frame[6:0], row[9:0], column[13:0]} * 32'h9E3779B1;
            pixel = mixed[31:24] ^ mixed[23:16];
            if (camera == 0) begin
                pixel = pixel >> 1;
                if (frame == 1 && row == SUN_Y && (column >= SUN_X || column == SUN_X - 2))
                    pixel = 200 + mixed[29:24] % 56;
                if (frame == 1 && row == 2 && (column == 638 || column == 639)) pixel = 255;
            end
        end
    endfunction

    // Cameras: free-running, joined in the last rows of frame 0.
    integer seed;
    integer half [0:1], frame [0:1], line [0:1], column [0:1];
    task advance(input integer camera);
        begin
            column[camera] = column[camera] + 1;
            if (column[camera] == LINE_CLOCKS) begin
                column[camera] = 0;
                line[camera] = line[camera] + 1;
                if (line[camera] == LINES) begin
                    line[camera] = 0;
                    frame[camera] = frame[camera] + 1;
                end
            end
        end
    endtask
    initial begin
        if (!$value$plusargs("seed=%d", seed)) seed = 1;
        half[0] = 37000;
        half[1] = 36000 + $unsigned($random(seed)) % 2000;
        frame[0] = 0;
        frame[1] = 0;
        line[0] = 475;
        line[1] = 470;
        column[0] = 100;
        column[1] = 300;
    end
    reg sun_camera_alive = 1;
    initial while (sun_camera_alive) begin
        #(half[0]) SUN_PCLK = 1;
        #(half[0]) SUN_PCLK = 0;
        SUN_HREF = column[0] < COLUMNS && line[0] < ROWS;
        SUN_Y_ = SUN_HREF ? pixel(0, frame[0], line[0], column[0]) : 8'hFF;
        advance(0);
    end
    initial #7 forever begin
        #(half[1]) NAD_PCLK = 1;
        #(half[1]) NAD_PCLK = 0;
        NAD_HREF = column[1] < COLUMNS && line[1] < ROWS;
        NAD_Y_ = NAD_HREF ? pixel(1, frame[1], line[1], column[1]) : 8'hFF;
        advance(1);
    end

    // SRAMs.
    integer sun_pulses = 0, nadir_pulses = 0, unstable = 0, contention = 0;
    always @(posedge sun_we_n) if (!sun_ce_n) begin
        sun_memory[sun_a] = sun_bus;
        sun_pulses = sun_pulses + 1;
    end
    always @(posedge nadir_we_n) if (!nadir_ce_n) begin
        nadir_memory[nadir_a] = nadir_bus;
        nadir_pulses = nadir_pulses + 1;
    end
    always @(sun_a or sun_bus) if (!sun_we_n && !sun_ce_n) unstable = unstable + 1;
    always @(nadir_a or nadir_bus) if (!nadir_we_n && !nadir_ce_n) unstable = unstable + 1;
    wire sun_clash = sun_d_oe & ~sun_oe_n, nadir_clash = nadir_d_oe & ~nadir_oe_n;
    always @(CONTENTION or sun_clash or nadir_clash) #1
        if (CONTENTION != 0 || sun_clash || nadir_clash) contention = contention + 1;

    // Requests: compare a memory with a camera's frame, or clock bytes out and compare them.
    // order: 0 the picture, 1 the nadir scan, 2 the Sun window.
    reg look = 0, read = 0, read_done = 0;
    integer memory = 0, camera = 0, expected = 0, order = 0;
    integer wrong_in_memory = -1, wrong_in_data = -1, clocks = 0, row, col, index;
    always @(posedge look) begin
        wrong_in_memory = 0;
        for (row = 0; row < ROWS; row = row + 1)
            for (col = 0; col < COLUMNS; col = col + 1)
                if ((memory ? nadir_memory[row * 1024 + col] : sun_memory[row * 1024 + col])
                        !== pixel(camera, expected, row, col))
                    wrong_in_memory = wrong_in_memory + 1;
    end
    task present;
        begin
            #30017 CLK = 1;
            #30003 clocks = clocks + 1;
        end
    endtask
    task compare(input [7:0] wanted);
        begin
            present;
            if (DATA !== wanted || !DATA_OE) wrong_in_data = wrong_in_data + 1;
            CLK = 0;
        end
    endtask
    always @(posedge read) begin
        read_done = 0;
        wrong_in_data = 0;
        clocks = 0;
        if (order == 0)
            for (index = 0; index < COLUMNS * ROWS; index = index + 1)
                compare(pixel(camera, expected, index / COLUMNS, index % COLUMNS));
        if (order == 1) begin
            present;
            CLK = 0;
            for (row = 15; row <= 463; row = row + 64)
                for (col = 0; col < COLUMNS; col = col + 1)
                    compare(pixel(camera, expected, row, col));
            present;
            CLK = 0;
            for (col = 63; col <= 639; col = col + 64)
                for (row = 0; row < ROWS; row = row + 1)
                    compare(pixel(camera, expected, row, col));
        end
        if (order == 2) begin
            compare(SUN_X % 256);
            compare(SUN_X / 256);
            compare(SUN_Y % 256);
            compare(SUN_Y / 256);
            for (row = 465; row < 480; row = row + 1)
                for (col = 625; col < 640; col = col + 1)
                    compare(pixel(camera, expected, row, col));
        end
        read_done = 1;
    end
endmodule
