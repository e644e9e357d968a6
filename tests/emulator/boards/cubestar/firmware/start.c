// Vectors and the clock: everything that these programs have in common.
#include "processor.h"

extern uint32_t stack_top, bss_start, bss_end;
int main(void);

void reset_handler(void) {
    for (uint32_t *to = &bss_start; to < &bss_end;)
        *to++ = 0;
    main();
    for (;;)
        __asm volatile("wfi");
}

__attribute__((weak)) void systick_handler(void) {}
__attribute__((weak)) void even_pins_handler(void) {}
__attribute__((weak)) void uart_handler(void) {}
__attribute__((weak)) void fault_handler(void) {
    for (;;) {}
}

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16 + 39] = {
    (uintptr_t)&stack_top,
    (uintptr_t)reset_handler,
    (uintptr_t)fault_handler,
    (uintptr_t)fault_handler,
    [15] = (uintptr_t)systick_handler,
    [16 + 1] = (uintptr_t)even_pins_handler,  // GPIO_EVEN
    [16 + SATELLITE_UART_RX_IRQ] = (uintptr_t)uart_handler,
};
