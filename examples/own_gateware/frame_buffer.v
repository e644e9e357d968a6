// CubeStar's frame buffer in plain Verilog, with one pin more: PARITY, beside ACK, is the parity of
// all bits of the stored image. Give it to any command:
//   cubestack measure cubestar --gateware frame_buffer.v
module frame_buffer #(
    parameter COLUMNS = 1024,
    parameter ROWS = 512,
    parameter COLUMN_BITS = $clog2(COLUMNS),
    parameter ROW_BITS = $clog2(ROWS)
) (
    input  wire       PIXCLK, HSYNC, VSYNC,
    input  wire [7:0] PIXDATA,
    input  wire       ENABLE, RNW, BANK, DCLK,
    output reg        ACK,
    output reg        PARITY,
    output reg  [7:0] DATA,
    output wire [COLUMN_BITS+ROW_BITS:0] SRAM_A,
    inout  wire [7:0] SRAM_D,
    output wire       SRAM_CE_N, SRAM_OE_N, SRAM_WE_N
);
    wire storing = ENABLE & ~RNW;
    wire reading = ENABLE & RNW;

    reg bank;
    always @(posedge ENABLE) bank <= BANK;

    // The reset falls at once and is released by the pixel clock.
    reg [1:0] released;
    wire reset = ~released[1];
    always @(posedge PIXCLK or negedge storing)
        if (!storing) released <= 0;
        else released <= {released[0], 1'b1};

    reg [COLUMN_BITS-1:0] column;
    reg [ROW_BITS-1:0] row;
    reg [7:0] pixel;
    reg store;      // the pixel is written while PIXCLK is low
    reg gap;        // HSYNC was low, so the next pixel begins a row
    reg open;       // a pixel of this row was taken
    reg full;       // the row is complete
    reg over;       // the last row is over
    wire last_column = store & column == COLUMNS - 1;
    wire last_row = row == ROWS - 1;
    wire short_row = ~HSYNC & open & ~full & ~last_column;
    wire take = HSYNC & VSYNC & gap & ~full & ~last_column & ~over & ~ACK;
    wire next_row = short_row | last_column;

    always @(posedge PIXCLK or posedge reset)
        if (reset) begin
            {column, row, pixel, store, gap, open, full, over, ACK, PARITY} <= 0;
        end else begin
            pixel <= PIXDATA;
            store <= take;
            gap <= ~HSYNC | (gap & VSYNC);
            open <= HSYNC & VSYNC & (open | take);
            full <= HSYNC & (full | last_column);
            over <= VSYNC & (over | (short_row & last_row));
            if (!VSYNC | next_row) column <= 0;
            else if (store) column <= column + 1'b1;
            if (!VSYNC | (next_row & last_row)) row <= 0;
            else if (next_row) row <= row + 1'b1;
            if (last_column & last_row) ACK <= 1;
            if (store) PARITY <= PARITY ^ (^pixel);
            else if (!VSYNC & ~ACK) PARITY <= 0;
        end

    reg [COLUMN_BITS-1:0] read_column;
    reg [ROW_BITS-1:0] read_row;
    always @(posedge DCLK or negedge reading)
        if (!reading) begin
            {read_column, read_row, DATA} <= 0;
        end else begin
            DATA <= SRAM_D;
            read_column <= read_column == COLUMNS - 1 ? 0 : read_column + 1'b1;
            if (read_column == COLUMNS - 1)
                read_row <= read_row == ROWS - 1 ? 0 : read_row + 1'b1;
        end

    assign SRAM_A = {bank, RNW ? {read_row, read_column} : {row, column}};
    assign SRAM_D = store ? pixel : 8'bz;
    assign SRAM_CE_N = ~ENABLE;
    assign SRAM_OE_N = ~reading;
    assign SRAM_WE_N = ~store | PIXCLK;
endmodule
