// Low-energy UART at 9600 baud in loop-back: sent by DMA, received by interrupt.
#include "driver.h"

#define LENGTH 24

static uint8_t sent[LENGTH];
static volatile uint8_t received[LENGTH];
static volatile uint32_t count;
static volatile bool transferred;

void LEUART0_IRQHandler(void) {
    while (LEUART0->STATUS & 1UL << 5) {
        const uint8_t byte = (uint8_t)LEUART0->RXDATA;
        if (count < LENGTH)
            received[count] = byte;
        count++;
    }
}

void DMA_IRQHandler(void) {
    DMA->IFC = 1;
    transferred = true;
}

static uint32_t leuart_init(uint32_t baud) {
    const uint32_t divider = (256UL * 32768 / baud - 256) & ~7UL;
    low_energy_clocks();
    CMU->LFBCLKEN0 |= CMU_LFBCLKEN0_LEUART0;
    LEUART0->CLKDIV = divider;
    LEUART0->CTRL = 1UL << 7;  // loop-back; 8 bits, no parity, 1 stop bit
    while (LEUART0->SYNCBUSY) ;
    LEUART0->CMD = 1 | 4;
    while (LEUART0->SYNCBUSY) ;
    LEUART0->IEN = 4;
    NVIC_EnableIRQ(LEUART0_IRQn);
    return divider;
}

int main(void) {
    driver_begin();
    for (int i = 0; i < LENGTH; i++)
        sent[i] = (uint8_t)(i * 73 + 5);
    const uint32_t divider = leuart_init(9600);
    const uint32_t began = CYCCNT;
    dma_start(0, 16UL << 16 | 1, &sent[LENGTH - 1], DMA_BYTE,
        &LEUART0->TXDATA, DMA_BYTE_FIXED, LENGTH);
    while (count < LENGTH) ;
    const uint32_t cycles = CYCCNT - began;
    check("DMA", transferred, true);
    for (int i = 0; i < LENGTH; i++)
        check("byte", received[i], sent[i]);
    // Ten bits each of 1 + divider / 256 periods; the first byte waits for its synchronization.
    const uint32_t expected = (uint32_t)(LENGTH * 10ULL * (256 + divider) * CORE_HZ / 256 / 32768);
    check_near("time", cycles, expected, 6 * CORE_HZ / 32768);
    driver_end();
}
