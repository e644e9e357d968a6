// DAC: codes converted back by the ADC inside of the part, and a table by DMA.
#include "driver.h"

static const uint32_t CODES[] = {0, 1, 1024, 2048, 3333, 4095};
static volatile bool transferred;

void DMA_IRQHandler(void) {
    DMA->IFC = 1;
    transferred = true;
}

static void dac_init(void) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_DAC0 | CMU_HFPERCLKEN0_ADC0;
    DAC0->CTRL = 6UL << 16 | 2UL << 8 | 3UL << 4;  // 750 kHz; the supply; to the pin and the ADC
    DAC0->CH0CTRL = 1;
    ADC0->CTRL = 47UL << 16 | 3UL << 8;
    ADC0->SINGLECTRL = 4UL << 20 | 2UL << 16 | 13UL << 8;  // channel 0 of the DAC, the supply
}

static void wait(uint32_t microseconds) {
    for (uint32_t began = CYCCNT; CYCCNT - began < microseconds * (CORE_HZ / 1000000);) ;
}

static uint32_t measure(void) {
    wait(50);
    ADC0->CMD = 1;
    while (!(ADC0->STATUS & 1UL << 16)) ;
    return ADC0->SINGLEDATA;
}

int main(void) {
    static uint32_t table[32];
    driver_begin();
    dac_init();
    for (unsigned i = 0; i < COUNT(CODES); i++) {
        DAC0->CH0DATA = CODES[i];
        const uint32_t expected = CODES[i] * 4096 / 4095;
        check_near("code", measure(), expected > 4095 ? 4095 : expected, 1);
    }
    for (unsigned i = 0; i < COUNT(table); i++)
        table[i] = 100 * i;
    dma_start(0, 10UL << 16, &table[COUNT(table) - 1], DMA_WORD,
        &DAC0->CH0DATA, DMA_WORD_FIXED, COUNT(table));
    SLEEP_UNTIL(transferred);
    check_near("table", measure(), 3100, 1);
    driver_end();
}
