/* SPDX-License-Identifier: BSD-2-Clause */
/* Start of the measuring program, whose functions are called and timed from outside. */
#include <stdint.h>

#define INTERRUPTS 40 /* more than this part has */

extern uint32_t stack_top, data_start, data_end, data_image, bss_start, bss_end;
void byte_interrupt(void);

/* Calls return here and stay. */
__attribute__((naked, noinline)) void returned(void) {
    __asm volatile("b .");
}

/* Faults end here, so that they differ from a returned call. */
__attribute__((naked, noinline)) static void failed(void) {
    __asm volatile("b .");
}

static void start(void) {
    const uint32_t *from = &data_image;
    for (uint32_t *to = &data_start; to < &data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = &bss_start; to < &bss_end; to++) {
        *to = 0;
    }
    returned();
}

__attribute__((section(".vectors"), used)) const struct {
    uint32_t *stack;
    void (*system[15])(void);
    void (*interrupts[INTERRUPTS])(void);
} vectors = {
    &stack_top,
    {start, failed, failed, failed, failed, failed},
    {[0 ... INTERRUPTS - 1] = byte_interrupt},
};
