// An I2C slave at 0x42, served by interrupts: 16 registers and a pointer that increments.
#include "device.h"

static volatile uint8_t registers[16] = {0xC0, 0xFF, 0xEE};
static volatile uint8_t pointer, first;

void I2C0_IRQHandler(void) {
    const uint32_t status = I2C0->IF;
    if (status & 1UL << 2) {  // address
        (void)I2C0->RXDATA;
        I2C0->IFC = 1UL << 2;
        I2C0->CMD = 4;
        if (I2C0->STATE & 1UL << 2) {  // we transmit
            I2C0->TXDATA = registers[pointer++ & 15];
            I2C0->IFC = 1UL << 6 | 1UL << 7;
        } else
            first = 1;
    } else if (status & 1UL << 5) {  // a byte
        const uint8_t byte = (uint8_t)I2C0->RXDATA;
        if (first)
            pointer = byte;
        else
            registers[pointer++ & 15] = byte;
        first = 0;
        I2C0->CMD = 4;
    }
    if (status & 1UL << 6) {  // the master wants one more
        I2C0->IFC = 1UL << 6;
        I2C0->TXDATA = registers[pointer++ & 15];
    }
    if (status & 1UL << 7)
        I2C0->IFC = 1UL << 7;
    if (status & 1UL << 16) {
        I2C0->IFC = 1UL << 16;
        I2C0->CMD = 0x40;
    }
}

int main(void) {
    console_init();
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_I2C0;
    GPIO->P[3].DOUTSET = 3UL << 6;
    GPIO->P[3].MODEL = (GPIO->P[3].MODEL & 0x00FFFFFFUL) | 8UL << 24 | 8UL << 28;  // PD6, PD7 wired-and
    I2C0->SADDR = 0x42 << 1;
    I2C0->SADDRMASK = 0x7F << 1;
    I2C0->ROUTE = 3 | 1 << 8;  // location 1
    I2C0->CTRL = 1 | 2 | 1 << 4;
    I2C0->CMD = 0x20;  // ABORT: the bus counts as idle
    I2C0->IFC = 0x1FFFF;
    I2C0->IEN = 1UL << 2 | 1UL << 5 | 1UL << 6 | 1UL << 7 | 1UL << 16;
    NVIC_EnableIRQ(I2C0_IRQn);
    console_write("slave\n");
    for (;;)
        __WFI();
}
