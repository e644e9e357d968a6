// Stores a whole frame, sleeping until ACK's interrupt, which it enables at cycle LATE, and strobes
// it over into the external SRAM.
#include "board.h"

#define LATE RAM_RESULTS[8]

static volatile uint32_t woken_at;

void even_pins_handler(void) {
    GPIO->IFC = 0xFFFF;
    woken_at = CYCLES;
}

static void start_external_ram(void) {
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_EBI;
    static const uint8_t outputs[] = {
        64 + 8, 64 + 9, 64 + 10, 64 + 11, 64 + 12, 64 + 13, 64 + 14, 64 + 15, 15, 0, 1, 2, 3,
        4,      5,      6,       48 + 9,  80 + 3,  80 + 4,  80 + 5};
    for (unsigned i = 0; i < sizeof outputs; i++)
        make(outputs[i], 4);
    EBI->ADDRTIMING = 1u << 8 | 1u;
    EBI->RDTIMING = 1u << 16 | 2u << 8 | 1u;
    EBI->WRTIMING = 1u << 16 | 2u << 8 | 1u;
    EBI->ROUTE = EBI_ROUTE_EBIPEN | EBI_ROUTE_CS0PEN | EBI_ROUTE_ALEPEN;
    EBI->CTRL = 2u << EBI_CTRL_MODE_SHIFT | EBI_CTRL_BANK0EN;
}

int main(void) {
    start_board();
    start_external_ram();
    volatile uint8_t *const memory = (volatile uint8_t *)0x80000000;
    volatile uint32_t *const out = RAM_RESULTS;
    set(FPGA_ENABLE, 1);
    while (CYCLES < LATE) {}
    GPIO->EXTIPSELH = 0;  // PA12
    GPIO->EXTIRISE = 1u << FPGA_ACK % 16;
    GPIO->IEN = 1u << FPGA_ACK % 16;
    *(volatile uint32_t *)0xE000E100 = 1u << 1;
    while (!woken_at)
        __asm volatile("wfi");
    out[0] = woken_at;
    set(FPGA_ENABLE, 0);
    set(FPGA_RNW, 1);
    set(FPGA_ENABLE, 1);
    for (uint32_t i = 0; i < 1024u * 512u; i++)
        memory[i] = strobe();
    set(FPGA_ENABLE, 0);
    out[1] = 0x600D;
    return 0;
}
