// Echoes each character plus one on a serial block that the test chooses, by the words below.
#include "processor.h"

const volatile uint32_t low_energy = 0;    // a LEUART
const volatile uint32_t base = 0x4000E000; // of the block's registers
const volatile uint32_t location = 1, tx = 64, rx = 65, divider = 0;

static void set_mode(uint32_t pin, uint32_t mode) {
    volatile uint32_t *port = (volatile uint32_t *)(0x40006000 + pin / 16 * 0x24);
    port[pin % 16 < 8 ? 1 : 2] |= mode << 4 * (pin % 8);
}

int main(void) {
    CMU->HFPERCLKEN0 = 0xFFFFFFFF;
    CMU->HFCORECLKEN0 = 1u << 4; // low-energy peripherals
    CMU->LFCLKSEL = 3u << 2;     // LFBCLK is HFCORECLK / 2
    CMU->LFBCLKEN0 = 3;
    set_mode(tx, 4);
    set_mode(rx, 1);
    if (low_energy) {
        LEUART_Registers *block = (LEUART_Registers *)base;
        block->CLKDIV = divider;
        block->ROUTE = 3u | location << 8;
        block->CMD = 5;
        for (;;)
            if (block->STATUS & LEUART_STATUS_RXDATAV)
                block->TXDATA = block->RXDATA + 1;
    }
    USART_Registers *block = (USART_Registers *)base;
    block->CLKDIV = divider;
    block->ROUTE = 3u | location << 8;
    block->CMD = 5;
    for (;;)
        if (block->STATUS & USART_STATUS_RXDATAV)
            block->TXDATA = block->RXDATA + 1;
}
