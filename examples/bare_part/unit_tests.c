// Unit tests that run on the processor; the exit status is the number of failures.
#include "debounce.h"

static int failures;

static int host_call(int operation, const void *parameter) { // semihosting
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void print(const char *text) { host_call(0x04, text); }

static void check(bool right, const char *what) {
    print(right ? "ok   " : "FAIL ");
    print(what);
    print("\n");
    failures += !right;
}

static int presses(const char *levels) {
    struct button button = {0};
    int count = 0;
    for (; *levels; levels++)
        count += debounce(&button, *levels == '1');
    return count;
}

int main(void) {
    check(presses("0000000000") == 0, "nothing pressed");
    check(presses("0011111111") == 1, "held: one press");
    check(presses("1111011110") == 0, "too short");
    check(presses("1010111111") == 1, "bounces: one press");
    check(presses("111111000001111111") == 2, "two presses");
    const uint32_t exit[] = {0x20026, (uint32_t)failures}; // ADP_Stopped_ApplicationExit
    host_call(0x20, exit);                                 // SYS_EXIT_EXTENDED
    return 0;
}
