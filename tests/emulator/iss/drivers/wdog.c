// Watchdog: fed ten times in time, then not; the next start finds the cause of the reset.
#include "driver.h"

// Beyond .bss and below the stack: keeps its value over a reset.
#define FED (*(volatile uint32_t *)0x20010000UL)
enum { POWER_ON = 1, BY_WATCHDOG = 1 << 4 };

static void wdog_init(uint32_t period) {
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    WDOG->CTRL = 1 | period << 8;  // the 1 kHz oscillator; 2^(3 + period) + 1 of its cycles
    while (WDOG->SYNCBUSY) ;
}

static void wait(uint32_t milliseconds) {
    for (uint32_t began = CYCCNT; CYCCNT - began < milliseconds * (CORE_HZ / 1000);) ;
}

int main(void) {
    driver_begin();
    const uint32_t cause = RMU->RSTCAUSE;
    RMU->CMD = 1;
    if (cause & POWER_ON) {
        FED = 0;
        wdog_init(0);
        for (int i = 0; i < 10; i++) {
            wait(5);
            while (WDOG->SYNCBUSY) ;
            WDOG->CMD = 1;
            FED++;
        }
        wait(100);
        check("reset", 0, 1);
    }
    check("cause", cause, BY_WATCHDOG);
    check("fed", FED, 10);
    driver_end();
}
