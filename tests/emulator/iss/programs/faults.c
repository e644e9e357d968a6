// Causes several faults; each handler prints its name and status, and skips the instruction.
#include "device.h"

typedef struct {
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
} Frame;

__attribute__((used)) static void report(Frame *frame, const char *name) {
    console_write(name);
    console_put(' ');
    console_hex(SCB->CFSR);
    console_put(' ');
    console_hex(SCB->HFSR);
    console_put('\n');
    SCB->CFSR = SCB->CFSR;
    SCB->HFSR = SCB->HFSR;
    const uint16_t first = *(const uint16_t *)frame->pc;
    frame->pc += (first >> 11) >= 0x1D ? 4 : 2;
}

#define HANDLER(name) \
    __attribute__((naked)) void name##_Handler(void) { \
        __asm volatile("mrs r0, msp\n ldr r1, =%0\n push {r4, lr}\n bl report\n pop {r4, pc}\n" ::"i"(#name)); \
    }
HANDLER(HardFault)
HANDLER(BusFault)
HANDLER(UsageFault)

int main(void) {
    console_init();
    SCB->CCR |= 1UL << 4 | 1UL << 3;  // trap divide by zero and unaligned access
    SCB->SHCSR |= 7UL << 16;
    volatile uint32_t zero = 0, number = 7;
    number /= zero;
    (void)*(volatile uint32_t *)(0x20000001UL);
    __asm volatile("udf #1");
    (void)*(volatile uint32_t *)0x60000000UL;
    SCB->SHCSR &= ~(7UL << 16);
    __asm volatile("udf #2");
    console_write("done\n");
    for (;;)
        __WFI();
}
