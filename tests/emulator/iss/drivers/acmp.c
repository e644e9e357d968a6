// Analog comparator: a voltage at its pin against half of the supply, both edges by interrupt.
#include "driver.h"

typedef struct {
    uint32_t bias, warm_up, supply_level;
    bool rising, falling;
} ACMP_Init;

static volatile uint32_t edges, history;

void ACMP0_IRQHandler(void) {
    ACMP0->IFC = 1;
    history = history << 1 | (ACMP0->STATUS >> 1 & 1);
    edges++;
}

static void acmp_init(const ACMP_Init *init, uint32_t channel) {
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_ACMP0;
    ACMP0->INPUTSEL = channel | 10UL << 4 | init->supply_level << 8;
    ACMP0->CTRL = init->bias << 24 | (uint32_t)init->falling << 17 | (uint32_t)init->rising << 16
        | init->warm_up << 8 | 1;
    while (!(ACMP0->STATUS & 1)) ;
    ACMP0->IFC = 3;
    ACMP0->IEN = 1;
    NVIC_EnableIRQ(ACMP0_IRQn);
}

int main(void) {
    const ACMP_Init init = {
        .bias = 7, .warm_up = 6, .supply_level = 32, .rising = true, .falling = true};
    driver_begin();
    acmp_init(&init, 2);
    check("low", ACMP0->STATUS, 1);
    console_write("go\n");
    SLEEP_UNTIL(edges >= 6);
    check("history", history, 0x2A);
    driver_end();
}
