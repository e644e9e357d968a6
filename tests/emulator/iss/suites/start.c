// From reset to newlib's start-up code, which clears .bss and calls main. A fault exits with status 139.
#include <stdint.h>

extern uint32_t __stack, end, data_load, data_start, data_end;
void _mainCRTStartup(void);

void reset_handler(void) {
    const uint32_t *from = &data_load;
    for (uint32_t *to = &data_start; to < &data_end;)
        *to++ = *from++;
    _mainCRTStartup();
}

static void semihosting(uint32_t number, const void *parameter) {
    register uint32_t operation __asm__("r0") = number;
    register const void *block __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xAB" : "+r"(operation) : "r"(block) : "memory");
}

__attribute__((used)) static void report(const uint32_t *stack) {
    static const uint32_t status[] = {0x20026, 139};
    // The stack grows down to the heap, and below it.
    semihosting(0x04, stack < &end ? "fault: the stack is larger than RAM\n" : "fault\n");
    semihosting(0x20, status);
}

__attribute__((naked)) static void fault_handler(void) {
    __asm__("mov r0, sp\n ldr r1, =__stack\n mov sp, r1\n b report");
}

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16] = {
    (uintptr_t)&__stack,
    (uintptr_t)reset_handler,
    (uintptr_t)fault_handler,
    (uintptr_t)fault_handler,
};
