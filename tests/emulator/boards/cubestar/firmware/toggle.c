// Stores for a while, looks at every pin in between, then strobes bytes: results into RAM.
#include "board.h"

int main(void) {
    start_board();
    volatile uint32_t *out = RAM_RESULTS;
    for (int round = 0; round < 3; round++) {
        set(FPGA_RNW, 0);
        set(FPGA_ENABLE, round > 0);  // first, what was in the memory before
        uint32_t polls = 0;
        while (!get(FPGA_ACK) && polls < 900)
            polls++;
        *out++ = polls;
        *out++ = strobe();  // while it stores: of no use, but no harm
        *out++ = CYCLES;
        set(FPGA_ENABLE, 0);
        set(FPGA_RNW, 1);
        set(FPGA_ENABLE, 1);
        for (int i = 0; i < 40; i++)
            *out++ = strobe();
        *out++ = CYCLES;
        set(FPGA_ENABLE, 0);
    }
    *out++ = 0x600D;
    return 0;
}
