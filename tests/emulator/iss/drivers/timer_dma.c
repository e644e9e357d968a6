// Timer: each overflow lets DMA copy one word; the end comes after as many periods.
#include "driver.h"

enum { WORDS = 16, PERIOD = 4800 };

static uint32_t from[WORDS], to[WORDS];
static volatile uint32_t ended;
static volatile bool transferred;

void DMA_IRQHandler(void) {
    DMA->IFC = 1;
    ended = CYCCNT;
    transferred = true;
}

static void timer_init(uint32_t period) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_TIMER0;
    TIMER0->CTRL = 0;
    TIMER0->TOP = period - 1;
    TIMER0->CNT = 0;
}

int main(void) {
    driver_begin();
    for (int i = 0; i < WORDS; i++)
        from[i] = 0x9E3779B9UL * (uint32_t)(i + 1);
    timer_init(PERIOD);
    dma_start(0, 24UL << 16, &from[WORDS - 1], DMA_WORD, &to[WORDS - 1], DMA_WORD, WORDS);
    const uint32_t began = CYCCNT;
    TIMER0->CMD = 1;
    while (!transferred) ;
    TIMER0->CMD = 2;
    check_near("time", ended - began, WORDS * PERIOD, 150);
    for (int i = 0; i < WORDS; i++)
        check("word", to[i], from[i]);
    driver_end();
}
