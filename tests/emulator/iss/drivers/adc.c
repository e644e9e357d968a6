// ADC: a scan of four channels whose results DMA stores.
#include "driver.h"

static const uint32_t MILLIVOLTS[] = {330, 1000, 1650, 3000};
static uint32_t results[COUNT(MILLIVOLTS)];
static volatile bool transferred;

void DMA_IRQHandler(void) {
    DMA->IFC = 1;
    transferred = true;
}

static void adc_init(uint32_t channels) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_ADC0;
    ADC0->CTRL = 47UL << 16 | 3UL << 8;                         // 1 us is 48 cycles; 12 MHz
    ADC0->SCANCTRL = 4UL << 20 | 2UL << 16 | channels << 8;     // 16 cycles; the supply, 12 bits
}

int main(void) {
    driver_begin();
    adc_init(0xF);
    for (int round = 0; round < 3; round++) {
        transferred = false;
        dma_start(0, 8UL << 16 | 1, &ADC0->SCANDATA, DMA_WORD_FIXED,
            &results[COUNT(results) - 1], DMA_WORD, COUNT(results));
        ADC0->CMD = 4;
        SLEEP_UNTIL(transferred);
        for (unsigned i = 0; i < COUNT(results); i++)
            check_near("result", results[i], MILLIVOLTS[i] * 4096 / 3300, 1);
    }
    check("lost", ADC0->IF & 1UL << 9, 0);
    driver_end();
}
