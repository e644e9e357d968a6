/* SPDX-License-Identifier: BSD-2-Clause */
/* The core's own instructions and registers, ARMv7-M Architecture Reference Manual. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

/* System control space, section B3.2 there. */
#define SCB_AIRCR (*(volatile uint32_t *)0xE000ED0Cu)
#define SCB_AIRCR_RESET 0x05FA0004u
#define SCB_DEMCR (*(volatile uint32_t *)0xE000EDFCu)
#define SCB_DEMCR_TRCENA (1u << 24)
#define NVIC_ENABLE ((volatile uint32_t *)0xE000E100u)
#define DWT_CTRL (*(volatile uint32_t *)0xE0001000u)
#define DWT_CYCCNT (*(volatile uint32_t *)0xE0001004u)

/* Masks interrupts; returns what `interrupts_restore` needs. */
static inline uint32_t interrupts_off(void)
{
    uint32_t masked;
    __asm volatile("mrs %0, primask\n cpsid i" : "=r"(masked) : : "memory");
    return masked;
}

static inline void interrupts_restore(uint32_t masked)
{
    __asm volatile("msr primask, %0" : : "r"(masked) : "memory");
}

/* Sleeps until an interrupt pends, also one that is masked. */
static inline void wait_for_interrupt(void)
{
    __asm volatile("dsb\n wfi" : : : "memory");
}

static inline void barrier(void)
{
    __asm volatile("dsb\n isb" : : : "memory");
}

static inline void interrupt_enable(int number)
{
    NVIC_ENABLE[number / 32] = 1u << number % 32;
}
