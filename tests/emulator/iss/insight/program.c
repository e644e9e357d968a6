/* A program with known calls at each tick, which sleeps between ticks and fails on request. */
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
enum { SYST_CSR = 0xE000E010, SYST_RVR = 0xE000E014, CCR = 0xE000ED14, SHCSR = 0xE000ED24 };

volatile uint32_t ticks, total, command, received;

__attribute__((noinline)) uint32_t square(uint32_t x) {
    __asm volatile(""); /* prevents that calls are merged */
    return x * x;
}

__attribute__((noinline)) uint32_t work(uint32_t n) {
    uint32_t sum = 0;
    for (uint32_t i = 0; i < n; i++)
        sum += square(i);
    return sum;
}

__attribute__((noinline)) void never(void) {
    total = 0;
}

__attribute__((noinline)) uint32_t divide(uint32_t a, uint32_t b) {
    return a / b;
}

__attribute__((noinline)) uint32_t overflow(uint32_t depth) {
    volatile uint32_t room[16];
    room[0] = depth;
    return room[0] + overflow(depth + 1);
}

__attribute__((noinline)) void crash(uint32_t how) {
    if (how == 1)
        total = divide(how, total - total);
    else if (how == 2)
        ((void (*)(void))0x60000001)();
    else if (how == 3)
        total = overflow(0);
    else if (how == 4)
        REGISTER(0x70000000) = 1;
    total++;
}

void SysTick_Handler(void) {
    ticks++;
    received = ticks & 0xFF;
}

int main(void) {
    REGISTER(CCR) |= 1 << 4; /* DIV_0_TRP */
    REGISTER(SYST_RVR) = 1399; /* 100 us */
    REGISTER(SYST_CSR) = 7;
    for (;;) {
        total += work(5);
        if (command)
            crash(command);
        __asm volatile("wfi");
    }
}

extern uint32_t stack_top;
void Reset_Handler(void) {
    main();
}
void HardFault_Handler(void) {
    for (;;)
        ;
}
__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, Reset_Handler, 0, HardFault_Handler, [15] = SysTick_Handler};
