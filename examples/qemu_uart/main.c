/* Firmware of an LM3S6965 (Cortex-M3) with a sensor on its second UART: requests telemetry 128 and
 * prints its first bytes on the first UART. The registers are those of Arm's PL011 (DDI 0183). */

#include <stdint.h>

#define UART(n) ((volatile uint32_t *)(0x4000C000u + 0x1000u * (n)))
enum { DATA = 0x00 / 4, FLAGS = 0x18 / 4, RECEIVE_EMPTY = 1 << 4, TRANSMIT_FULL = 1 << 5 };

extern uint32_t stack_end;
void start(void);

__attribute__((section(".vectors"), used)) static void *const vectors[] = {&stack_end, start};

static void put(int uart, uint8_t byte)
{
    while (UART(uart)[FLAGS] & TRANSMIT_FULL) {}
    UART(uart)[DATA] = byte;
}

static uint8_t get(int uart)
{
    while (UART(uart)[FLAGS] & RECEIVE_EMPTY) {}
    return (uint8_t)UART(uart)[DATA];
}

static void print_hex(uint8_t byte)
{
    for (int shift = 4; shift >= 0; shift -= 4) put(0, (uint8_t)"0123456789abcdef"[byte >> shift & 15]);
}

/* Semihosting's SYS_EXIT with ADP_Stopped_ApplicationExit. */
static void leave(void)
{
    register uint32_t call __asm__("r0") = 0x18, reason __asm__("r1") = 0x20026;
    __asm__ volatile("bkpt 0xab" : : "r"(call), "r"(reason) : "memory");
}

void start(void)
{
    static const uint8_t request[] = {0x1F, 0x7F, 0x80, 0x1F, 0xFF};
    for (unsigned i = 0; i < sizeof request; i++) put(1, request[i]);
    while (get(1) != 0x1F || get(1) != 0x7F) {}
    for (int i = 0; i < 4; i++) print_hex(get(1));
    put(0, '\n');
    leave();
    for (;;) {}
}
