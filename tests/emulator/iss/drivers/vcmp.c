// Supply comparator: the supply falls below 2.62 V and recovers, by interrupt.
#include "driver.h"

static volatile uint32_t edges, history;

void VCMP_IRQHandler(void) {
    VCMP->IFC = 1;
    history = history << 1 | (VCMP->STATUS >> 1 & 1);
    edges++;
}

static void vcmp_init(uint32_t millivolts) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_VCMP;
    VCMP->INPUTSEL = (millivolts - 1667 + 33) / 34;
    VCMP->CTRL = 7UL << 24 | 3UL << 16 | 6UL << 8 | 1;
    while (!(VCMP->STATUS & 1)) ;
    VCMP->IFC = 3;
    VCMP->IEN = 1;
    NVIC_EnableIRQ(VCMP_IRQn);
}

int main(void) {
    driver_begin();
    vcmp_init(2600);
    check("supply", VCMP->STATUS, 3);
    console_write("go\n");
    SLEEP_UNTIL(edges >= 4);
    check("history", history, 5);  // below, above, below, above
    driver_end();
}
