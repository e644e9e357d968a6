/* SPDX-License-Identifier: BSD-2-Clause */
/* Watchdog, clocked by the 1 kHz oscillator that always runs. */
#include "reset.h"

#include "efm32gg.h"

#define PERIOD_2049 8u

void watchdog_start(void)
{
    while (WDOG->SYNCBUSY)
        ;
    WDOG->CTRL = WDOG_CTRL_EN | PERIOD_2049 << WDOG_CTRL_PERSEL_SHIFT;
}

void watchdog_feed(void)
{
    if (!(WDOG->SYNCBUSY & WDOG_SYNCBUSY_CMD)) /* the last one is still being synchronised */
        WDOG->CMD = WDOG_CMD_CLEAR;
}
