// LESENSE: a scan of eight inputs in each millisecond, by comparator; results by interrupt.
#include "driver.h"

enum { SCANS = 5, PERIOD = 33 };
enum { SCAN_COMPLETE = 1 << 16 };

static volatile uint32_t scans, results[SCANS], times[SCANS];

void LESENSE_IRQHandler(void) {
    LESENSE->IFC = SCAN_COMPLETE;
    if (scans < SCANS) {
        results[scans] = LESENSE->SCANRES;
        times[scans] = CYCCNT;
    }
    scans++;
}

static void lesense_init(uint32_t channels) {
    low_energy_clocks();
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_ACMP0;
    CMU->LFACLKEN0 |= CMU_LFACLKEN0_LESENSE;
    ACMP0->INPUTSEL = 10UL << 4 | 32UL << 8;  // against half of the supply
    LESENSE->CTRL = 0;                        // periodic
    LESENSE->TIMCTRL = (PERIOD - 1UL) << 12;
    LESENSE->PERCTRL = 1UL << 20;             // LESENSE selects the input of ACMP0
    LESENSE->DECCTRL = 1;
    LESENSE->CHEN = channels;
    for (int i = 0; i < 16; i++)
        if (channels >> i & 1) {
            LESENSE->CH[i].TIMING = 0;
            LESENSE->CH[i].INTERACT = 1UL << 12;  // the output of the comparator
            LESENSE->CH[i].EVAL = 0;
        }
    while (LESENSE->SYNCBUSY) ;
    LESENSE->IFC = 0x7FFFFF;
    LESENSE->IEN = SCAN_COMPLETE;
    NVIC_EnableIRQ(LESENSE_IRQn);
    LESENSE->CMD = 1;
}

int main(void) {
    driver_begin();
    lesense_init(0xFF);
    while (scans < SCANS) ;
    LESENSE->CMD = 2;
    for (int i = 0; i < SCANS; i++)
        check("result", results[i], 0x65);
    for (int i = 1; i < SCANS; i++)
        check_near("period", times[i] - times[i - 1],
            (uint32_t)(PERIOD * (uint64_t)CORE_HZ / 32768), CORE_HZ / 32768);
    driver_end();
}
