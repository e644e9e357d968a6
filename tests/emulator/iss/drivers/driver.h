// What every driver program here uses: clocks, DMA, time, and the report of its checks.
#ifndef DRIVER_H
#define DRIVER_H

#include <stdbool.h>

#include "device.h"

typedef struct {
    volatile void *source_end, *destination_end;
    volatile uint32_t control, user;
} DMA_Descriptor;

// Increment and size of an end of a transfer, as in the control word of a descriptor.
enum { DMA_WORD = 0xA, DMA_WORD_FIXED = 0xE, DMA_BYTE = 0, DMA_BYTE_FIXED = 0xC };

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define CORE_HZ 48000000UL
#define CYCCNT (*(__IO uint32_t *)0xE0001004UL)

// Sleeps until an interrupt fulfils the condition; one that comes just before WFI wakes it too.
#define SLEEP_UNTIL(condition)                   \
    for (__disable_irq(); !(condition); __disable_irq()) { \
        __WFI();                                 \
        __asm volatile("cpsie i\n isb" ::: "memory"); \
    }                                            \
    __asm volatile("cpsie i" ::: "memory")

static int failures;

// Prints what differs; the test expects no line but the last.
static void check_near(const char *what, uint32_t value, uint32_t expected, uint32_t tolerance) {
    if (value - expected + tolerance <= 2 * tolerance)
        return;
    failures++;
    console_write(what);
    console_put(' ');
    console_hex(value);
    console_write(" instead of ");
    console_hex(expected);
    console_put('\n');
}

static void check(const char *what, uint32_t value, uint32_t expected) {
    check_near(what, value, expected, 0);
}

static void start_counting_cycles(void) {
    *(__IO uint32_t *)0xE000EDFCUL |= 1UL << 24;
    *(__IO uint32_t *)0xE0001000UL |= 1;
}

// The low-energy interface, and LFRCO for its A and B branches.
static inline void low_energy_clocks(void) {
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    CMU->OSCENCMD = CMU_OSCENCMD_LFRCOEN;
    while (!(CMU->STATUS & CMU_STATUS_LFRCORDY)) ;
    CMU->LFCLKSEL = (CMU->LFCLKSEL & ~0xFUL) | 1 | 1 << 2;
}

// One transfer of ``count`` items, one per request; ``sizes`` are those of an end each.
static inline void dma_start(int channel, uint32_t request, volatile void *source_end,
    int source_size, volatile void *destination_end, int destination_size, uint32_t count) {
    static DMA_Descriptor descriptors[32] __attribute__((aligned(512)));
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_DMA;
    DMA_Descriptor *const one = &descriptors[channel];
    one->source_end = source_end;
    one->destination_end = destination_end;
    one->control = (uint32_t)destination_size << 28 | (uint32_t)source_size << 24
        | (count - 1) << 4 | 1;
    DMA->CTRLBASE = (uint32_t)descriptors;
    DMA->CONFIG = 1;
    DMA->CH[channel].CTRL = request;
    DMA->CHREQMASKC = 1UL << channel;
    DMA->CHUSEBURSTC = 1UL << channel;
    DMA->CHALTC = 1UL << channel;
    DMA->IFC = 1UL << channel;
    DMA->IEN |= 1UL << channel;
    NVIC_EnableIRQ(DMA_IRQn);
    DMA->CHENS = 1UL << channel;
}

static void driver_begin(void) {
    console_init();
    start_counting_cycles();
}

static void driver_end(void) {
    console_write(failures ? "failed\n" : "ok\n");
    for (;;)
        __WFI();
}

#endif
