// A timer starts the ADC through the PRS, 1000 times per second; the processor sleeps meanwhile.
#include "device.h"

#define SAMPLES 16

static volatile uint32_t count, sum;

void ADC0_IRQHandler(void) {
    ADC0->IFC = 1;
    sum += ADC0->SINGLEDATA;
    if (++count == SAMPLES)
        TIMER0->CMD = 2;                             // stop
}

int main(void) {
    console_init();
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_TIMER0 | CMU_HFPERCLKEN0_PRS | CMU_HFPERCLKEN0_ADC0;
    PRS->CH_CTRL[0] = 0x1CUL << 16 | 1;              // TIMER0, overflow
    ADC0->CTRL = 47UL << 16 | 3UL << 8;              // 1 us is 48 cycles; 12 MHz
    ADC0->SINGLECTRL = 3UL << 20 | 2UL << 16 | 1UL << 24;    // channel 0, VDD, PRS channel 0
    ADC0->IEN = 1;
    NVIC_EnableIRQ(ADC0_IRQn);
    TIMER0->TOP = 2999;
    TIMER0->CTRL = 4UL << 24;                        // 3 MHz
    console_write("start ");
    while (!(UART0->STATUS & USART_STATUS_TXC)) ;
    TIMER0->CMD = 1;
    while (count < SAMPLES)
        __WFI();
    console_hex(sum / SAMPLES);
    console_put('\n');
    for (;;)
        __WFI();
}
