/* SPDX-License-Identifier: BSD-2-Clause */
/* Vectors, and the code before main. ARMv7-M Architecture Reference Manual, section B1.5. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "drivers/clock.h"
#include "efm32gg.h"
#include "pins.h"

extern uint32_t stack_top, data_from[], data_start[], data_end[], bss_start[], bss_end[];

int main(void);

/* A fault, or an interrupt that was not enabled: the watchdog resets the processor. */
void unexpected_handler(void)
{
    for (;;)
        ;
}

/* The node is deaf until main runs, so the fast clock starts first; it needs no RAM. */
void reset_handler(void)
{
    clock_start();
    memcpy(data_start, data_from, (size_t)((char *)data_end - (char *)data_start));
    memset(bss_start, 0, (size_t)((char *)bss_end - (char *)bss_start));
    main();
    unexpected_handler();
}

void TIMER2_handler(void);
void TIMER3_handler(void);
void ACMP0_handler(void);
void uart_receive_handler(void);
void uart_send_handler(void);
void i2c_slave_handler(void);

#define EXCEPTIONS 16
#define INTERRUPTS 39

typedef void (*vector)(void);

__attribute__((section(".vectors"), used)) static const vector vectors[EXCEPTIONS + INTERRUPTS] = {
    [0] = (vector)&stack_top,
    [1] = reset_handler,
    [2 ... EXCEPTIONS + INTERRUPTS - 1] = unexpected_handler,
    [EXCEPTIONS + TIMER2_IRQ] = TIMER2_handler,
    [EXCEPTIONS + TIMER3_IRQ] = TIMER3_handler,
    [EXCEPTIONS + ACMP0_IRQ] = ACMP0_handler,
    [EXCEPTIONS + SATELLITE_UART_RX_IRQ] = uart_receive_handler,
    [EXCEPTIONS + SATELLITE_UART_TX_IRQ] = uart_send_handler,
    [EXCEPTIONS + SATELLITE_I2C_IRQ] = i2c_slave_handler,
};
