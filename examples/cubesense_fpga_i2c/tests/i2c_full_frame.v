// The pair of FPGAs on its I2C bus at full size, with a master and the nadir's SRAM in Verilog,
// because Python would need half an hour for a picture. cocotb makes the requests.
//
// The sun's half rests. Both cameras' clocks stand still.
module i2c_full_frame;
    parameter COLUMNS = 640;
    parameter ROWS = 480;

    // Unknown until time 1, since Icarus computes nothing from pins that never change.
    reg SCL, SDA_I, RESET_N, zero;
    reg [7:0] zeros;
    initial #1 {SCL, SDA_I, RESET_N, zero, zeros} = {4'b1100, 8'h00};
    wire SDA;
    wire [1:0] CONTENTION;
    wire [18:0] address;
    wire [7:0] bus, d_o;
    wire d_oe, ce_n, oe_n, we_n;
    reg [7:0] memory [0:(1 << 19) - 1];
    assign bus = d_oe ? d_o : 8'bz;
    assign bus = (ce_n | oe_n | ~we_n) ? 8'bz : memory[address];

    dut dut (
        .SUN_Y(zeros), .SUN_HREF(zero), .SUN_PCLK(zero), .SUN_SRAM_D_I(zeros),
        .NAD_Y(zeros), .NAD_HREF(zero), .NAD_PCLK(zero), .NAD_SRAM_D_I(bus),
        .NAD_SRAM_A(address), .NAD_SRAM_D_O(d_o), .NAD_SRAM_D_OE(d_oe),
        .NAD_SRAM_CE_N(ce_n), .NAD_SRAM_OE_N(oe_n), .NAD_SRAM_WE_N(we_n),
        .SCL(SCL), .SDA_I(SDA_I), .SDA(SDA), .RESET_N(RESET_N), .CONTENTION(CONTENTION)
    );

    integer index;
    reg [31:0] mixed;
    initial for (index = 0; index < 1 << 19; index = index + 1) begin
        mixed = index * 32'h9E3779B1;
        mixed = (mixed ^ (mixed >> 15)) * 32'h2C1B3C6D;
        memory[index] = mixed[31:24];
    end

    // The master; a quarter of a period between any two edges, two of them with SCL high.
    integer quarter = 250000, refused = 0, bits;
    reg [7:0] received;
    task start;
        begin
            SDA_I = 0; #(quarter) SCL = 0; #(quarter);
        end
    endtask
    task again;
        begin
            SDA_I = 1; #(quarter) SCL = 1; #(quarter) start;
        end
    endtask
    task stop;
        begin
            SDA_I = 0; #(quarter) SCL = 1; #(quarter) SDA_I = 1; #(quarter);
        end
    endtask
    task one_bit(input level);
        begin
            SDA_I = level;
            #(quarter) SCL = 1;
            #(quarter) received = {received[6:0], SDA};
            #(quarter) SCL = 0;
            #(quarter);
        end
    endtask
    task put(input [7:0] value);
        begin
            for (bits = 7; bits >= 0; bits = bits - 1) one_bit(value[bits]);
            one_bit(1);
            if (received[0] !== 0) refused = refused + 1;
        end
    endtask
    reg [7:0] got;
    task get(input last);
        begin
            for (bits = 0; bits < 8; bits = bits + 1) one_bit(1);
            got = received;
            one_bit(last);
        end
    endtask

    // Requests. command: its byte to the group. read: count bytes from a pixel on.
    reg command = 0, read = 0, done = 0, down = 0;
    integer value = 0, x = 0, y = 0, count = 0, wrong = 0, group = 0, target = 0, at, row, column;
    always @(posedge command) begin
        done = 0;
        start; put({group[6:0], 1'b0}); put(8'h02); put(value[7:0]); stop;
        done = 1;
    end
    always @(posedge read) begin
        done = 0;
        start; put({target[6:0], 1'b0}); put(8'h0C);
        at = y * 1024 + x;
        put({down, 4'b0000, at[18:16]}); put(at[15:8]); put(at[7:0]);
        again; put({target[6:0], 1'b1});
        row = y;
        column = x;
        for (index = 1; index <= count; index = index + 1) begin
            get(index == count);
            if (got !== memory[row * 1024 + column]) wrong = wrong + 1;
            if (!down) column = (column + 1) % COLUMNS;
            if (down || column == 0) row = (row + 1) % ROWS;
        end
        stop;
        done = 1;
    end
endmodule
