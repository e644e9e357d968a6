// Low-energy timer: five periods of 100 ticks, then it stops by itself; underflows by interrupt.
#include "driver.h"

enum { TICKS = 100, PERIODS = 5 };
static volatile uint32_t underflows, ends, times[PERIODS + 1];

void LETIMER0_IRQHandler(void) {
    const uint32_t flags = LETIMER0->IF;
    LETIMER0->IFC = flags;
    if (flags & 4 && underflows <= PERIODS)
        times[underflows++] = CYCCNT;
    if (flags & 8)
        ends++;
}

static void letimer_init(uint32_t ticks, uint32_t repeats) {
    low_energy_clocks();
    CMU->LFACLKEN0 |= CMU_LFACLKEN0_LETIMER0;
    LETIMER0->COMP0 = ticks - 1;
    LETIMER0->REP0 = repeats;
    LETIMER0->CTRL = 1UL << 9 | 1;  // COMP0 is the top; REP0 counts down
    while (LETIMER0->SYNCBUSY) ;
    LETIMER0->CNT = ticks - 1;
    LETIMER0->IFC = 0x1F;
    LETIMER0->IEN = 4 | 8;
    NVIC_EnableIRQ(LETIMER0_IRQn);
    LETIMER0->CMD = 1;
    while (LETIMER0->SYNCBUSY) ;
}

int main(void) {
    driver_begin();
    letimer_init(TICKS, PERIODS);
    check("running", LETIMER0->STATUS & 1, 1);
    while (!ends) ;
    check("stopped", LETIMER0->STATUS & 1, 0);
    check("underflows", underflows, PERIODS);
    for (int i = 1; i < PERIODS; i++)
        check_near("period", times[i] - times[i - 1],
            (uint32_t)(TICKS * (uint64_t)CORE_HZ / 32768), CORE_HZ / 32768 / 4);
    driver_end();
}
