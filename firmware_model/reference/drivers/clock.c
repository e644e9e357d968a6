/* SPDX-License-Identifier: BSD-2-Clause */
/* Clocks, the free-running timer and sleep.
 *
 * EFM32GG Reference Manual, chapters 7 (MSC), 11 (CMU), 20 (TIMER), 22 (BURTC). TIMER0 and 1 count
 * thirds of a microsecond from reset to reset. BURTC counts through resets, so that the time
 * continues after one: it has 32 768 counts per second, 512 of which are 15 625 us. Until its
 * crystal has started, the time before `timer_start` is assumed to be RESTART_US. */
#include "clock.h"

#include "core.h"
#include "efm32gg.h"
#include "state.h"
#include "reset.h"

#define WAIT_STATES_2 4u /* above 32 MHz */
#define HFXO_ABOVE_32_MHZ 3u
#define LFXO_AFTER_1K_CYCLES 1u /* to be ready within a turn of the loop */
#define SELECT_HFXO 2u
#define BURTC_FROM_LFXO 2u
#define BURTC_IN_EM4 3u

#define TICKS_PER_US 3u
#define PRESCALED_BY_16 4u
#define CLOCKED_BY_NEIGHBOUR 2u

#define ALARM_HZ 46875u
#define PRESCALED_BY_1024 10u
#define LONGEST_ALARM_US 1300000u /* of 16 bits; within the watchdog's time */
#define SHORTEST_ALARM_US 50u

#define SLICE_COUNTS 512u
#define SLICE_US 15625u
#define RESTART_US 1420u /* the fast crystal starts, the RAM is set up */

static uint64_t now_us;
static uint32_t seen_ticks;
static volatile bool woken;

void clock_start(void)
{
    MSC->READCTRL = (MSC->READCTRL & ~MSC_READCTRL_MODE) |
                    WAIT_STATES_2 << MSC_READCTRL_MODE_SHIFT | MSC_READCTRL_PREFETCH;
    CMU->CTRL = (CMU->CTRL & ~(CMU_CTRL_HFXOBUFCUR | CMU_CTRL_LFXOTIMEOUT)) |
                HFXO_ABOVE_32_MHZ << CMU_CTRL_HFXOBUFCUR_SHIFT |
                LFXO_AFTER_1K_CYCLES << CMU_CTRL_LFXOTIMEOUT_SHIFT | CMU_CTRL_HFLE;
    CMU->HFCORECLKDIV |= CMU_HFCORECLKDIV_HFCORECLKLEDIV;
    CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN | CMU_OSCENCMD_LFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_HFXORDY))
        ;
    CMU->CMD = SELECT_HFXO << CMU_CMD_HFCLKSEL_SHIFT;
    CMU->OSCENCMD = CMU_OSCENCMD_HFRCODIS;
    CMU->HFCORECLKEN0 = CMU_HFCORECLKEN0_LE | CMU_HFCORECLKEN0_EBI;
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_GPIO | CMU_HFPERCLKEN0_TIMER0 | CMU_HFPERCLKEN0_TIMER1 |
                       CMU_HFPERCLKEN0_TIMER2 | CMU_HFPERCLKEN0_TIMER3 | CMU_HFPERCLKEN0_ADC0 |
                       CMU_HFPERCLKEN0_ACMP0 | CMU_HFPERCLKEN0_ACMP1 | CMU_HFPERCLKEN0_I2C0 |
                       CMU_HFPERCLKEN0_I2C1 | CMU_HFPERCLKEN0_USART0 | CMU_HFPERCLKEN0_USART1 |
                       CMU_HFPERCLKEN0_USART2 | CMU_HFPERCLKEN0_UART0 | CMU_HFPERCLKEN0_UART1;
    SCB_DEMCR |= SCB_DEMCR_TRCENA;
    DWT_CTRL |= 1; /* counts cycles, for the times of the steps */
}

/* --- the free-running timer ------------------------------------------------------------------- */

static uint32_t ticks(void)
{
    uint32_t high = TIMER1->CNT, low = TIMER0->CNT, again = TIMER1->CNT;
    if (high != again)
        low = TIMER0->CNT;
    return again << 16 | low;
}

/* The time from BURTC, at a step of its count. */
static uint64_t burtc_us(void)
{
    uint32_t first = BURTC->CNT, counts;
    while ((counts = BURTC->CNT) == first)
        ;
    counts -= retained.clock_ticks;
    return retained.clock_us + (uint64_t)counts * SLICE_US / SLICE_COUNTS;
}

void timer_start(void)
{
    TIMER0->CTRL = PRESCALED_BY_16 << TIMER_CTRL_PRESC_SHIFT;
    TIMER1->CTRL = CLOCKED_BY_NEIGHBOUR << TIMER_CTRL_CLKSEL_SHIFT;
    TIMER1->CMD = TIMER_CMD_START;
    if (retained.clock_runs)
        now_us = burtc_us();
    else
        now_us = retained.reset_us + RESTART_US;
    TIMER0->CMD = TIMER_CMD_START;
    TIMER2->CTRL = PRESCALED_BY_1024 << TIMER_CTRL_PRESC_SHIFT | TIMER_CTRL_OSMEN;
    TIMER2->IEN = TIMER_IEN_OF;
    interrupt_enable(TIMER2_IRQ);
}

uint64_t time_us(void)
{
    uint32_t masked = interrupts_off();
    uint32_t passed = (ticks() - seen_ticks) / TICKS_PER_US;
    seen_ticks += TICKS_PER_US * passed;
    now_us += passed;
    uint64_t now = now_us;
    interrupts_restore(masked);
    return now;
}

uint32_t since(uint64_t started_us)
{
    return (uint32_t)(time_us() - started_us);
}

void timer_retain(void)
{
    if (!retained.clock_runs) {
        if (!(CMU->STATUS & CMU_STATUS_LFXORDY))
            return;
        BURTC->CTRL = BURTC_IN_EM4 << BURTC_CTRL_MODE_SHIFT |
                      BURTC_FROM_LFXO << BURTC_CTRL_CLKSEL_SHIFT;
        uint32_t masked = interrupts_off();
        retained.clock_us = time_us();
        retained.clock_ticks = BURTC->CNT;
        retained.clock_runs = 1;
        interrupts_restore(masked);
        return;
    }
    uint32_t slices = (BURTC->CNT - retained.clock_ticks) / SLICE_COUNTS;
    retained.clock_ticks += slices * SLICE_COUNTS;
    retained.clock_us += (uint64_t)slices * SLICE_US;
}

/* One turn takes three cycles. */
void spin_us(uint32_t us)
{
    uint32_t turns = us * (CLOCK_HZ / 1000000u) / 3u;
    __asm volatile("1: subs %0, #1\n bne 1b" : "+r"(turns) : : "cc");
}

/* --- sleep ------------------------------------------------------------------------------------ */

void TIMER2_handler(void)
{
    TIMER2->IFC = TIMER_IFC_OF;
}

void wake(void)
{
    woken = true;
}

static void sleep_for(uint64_t us)
{
    uint32_t limited = us > LONGEST_ALARM_US ? LONGEST_ALARM_US : (uint32_t)us;
    if (limited < SHORTEST_ALARM_US)
        return; /* the caller's loop waits */
    TIMER2->CNT = 0;
    TIMER2->TOP = (uint32_t)((uint64_t)limited * ALARM_HZ / 1000000u) - 1;
    TIMER2->CMD = TIMER_CMD_START;
    wait_for_interrupt();
    TIMER2->CMD = TIMER_CMD_STOP;
}

bool sleep_until(uint64_t due_us, bool wakeable)
{
    for (;;) {
        watchdog_feed();
        uint32_t masked = interrupts_off();
        if (wakeable && woken) {
            woken = false;
            interrupts_restore(masked);
            return true;
        }
        uint64_t now = time_us();
        if (now < due_us)
            sleep_for(due_us - now);
        interrupts_restore(masked); /* the interrupt that ended the sleep is served here */
        if (now >= due_us)
            return false;
    }
}

void pause_us(uint32_t us)
{
    sleep_until(time_us() + us, false);
}
