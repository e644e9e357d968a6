/* Start-up of a load on the part. The result is in r0 at `finished`. */

#include "load.inc"

extern uint32_t data_source[], data_start[], data_end[], bss_start[], bss_end[], stack_top[];

__attribute__((naked, used)) void finished(void) { __asm volatile("b ."); }

__attribute__((naked, used)) void fault(void) { __asm volatile("b ."); }

__attribute__((used)) void start(void) {
    for (uint32_t *to = data_start, *from = data_source; to < data_end;) *to++ = *from++;
    for (uint32_t *to = bss_start; to < bss_end;) *to++ = 0;
    const uint32_t sum = load(SEED, ROUNDS);
    __asm volatile("mov r0, %0\n b finished" : : "r"(sum) : "r0");
}

__attribute__((section(".vectors"), used)) const void *const vectors[16] = {
    stack_top, start, fault, fault, fault, fault, fault};
