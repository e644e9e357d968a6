// Pulse counter: 25 pulses at a pin, ten per turn; overflows by interrupt.
#include "driver.h"

static volatile uint32_t turns;

void PCNT0_IRQHandler(void) {
    PCNT0->IFC = 2;
    turns++;
}

static void pcnt_init(uint32_t top) {
    low_energy_clocks();
    CMU->PCNTCTRL = 1;  // counter 0, on the clock of the A branch
    GPIO->P[2].MODEH = (GPIO->P[2].MODEH & ~(0xFUL << 20)) | 1UL << 20;  // PC13 input
    PCNT0->TOPB = top;
    PCNT0->CMD = 2;
    while (PCNT0->SYNCBUSY) ;
    PCNT0->CTRL = 1;  // one input, sampled
    while (PCNT0->SYNCBUSY) ;
    PCNT0->IFC = 0xF;
    PCNT0->IEN = 2;
    NVIC_EnableIRQ(PCNT0_IRQn);
}

int main(void) {
    driver_begin();
    pcnt_init(9);
    check("top", PCNT0->TOP, 9);
    console_write("go\n");
    while (turns < 2 || PCNT0->CNT < 5) ;
    for (uint32_t began = CYCCNT; CYCCNT - began < CORE_HZ / 1000;) ;
    check("turns", turns, 2);
    check("count", PCNT0->CNT, 5);
    driver_end();
}
