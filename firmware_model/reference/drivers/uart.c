/* SPDX-License-Identifier: BSD-2-Clause */
/* The satellite's UART. EFM32GG Reference Manual, chapter 17.
 *
 * TIMER3 runs from the latest byte on: a message that stays incomplete for 100 byte times is
 * dropped. */
#include "uart.h"

#include <stdbool.h>

#include "clock.h"
#include "core.h"
#include "cubestar.h"
#include "efm32gg.h"
#include "gpio.h"
#include "pins.h"

#define DIVIDER (256u * (CLOCK_HZ / 16u) / CUBESTAR_BAUD - 256u)
#define SILENCE_BYTES 100u
#define SILENCE_TICKS (SILENCE_BYTES * 10u * (CLOCK_HZ / 1024u) / CUBESTAR_BAUD)
#define PRESCALED_BY_1024 10u

static uint8_t ring[UART_SEND_BYTES];
static volatile unsigned head, tail; /* counts; they wrap */
static bool sent_anything;

void uart_start(void)
{
    pin_set_up(SATELLITE_UART_TX_PIN, PIN_OUTPUT, 1);
    pin_set_up(SATELLITE_UART_RX_PIN, PIN_INPUT, 1);
    SATELLITE_UART->CLKDIV = DIVIDER & USART_CLKDIV_DIV;
    SATELLITE_UART->ROUTE = USART_ROUTE_RXPEN | USART_ROUTE_TXPEN |
                            SATELLITE_UART_LOCATION << USART_ROUTE_LOCATION_SHIFT;
    SATELLITE_UART->CMD = USART_CMD_RXEN | USART_CMD_TXEN;
    SATELLITE_UART->IEN = USART_IEN_RXDATAV;
    interrupt_enable(SATELLITE_UART_RX_IRQ);
    interrupt_enable(SATELLITE_UART_TX_IRQ);
    TIMER3->CTRL = PRESCALED_BY_1024 << TIMER_CTRL_PRESC_SHIFT | TIMER_CTRL_OSMEN;
    TIMER3->TOP = SILENCE_TICKS;
    TIMER3->IEN = TIMER_IEN_OF;
    interrupt_enable(TIMER3_IRQ);
}

void uart_send(const uint8_t *data, int count)
{
    uint32_t masked = interrupts_off();
    for (int i = 0; i < count; i++)
        ring[head++ % UART_SEND_BYTES] = data[i];
    sent_anything |= count > 0;
    SATELLITE_UART->IEN |= USART_IEN_TXBL;
    interrupts_restore(masked);
}

int uart_backlog(void)
{
    uint32_t masked = interrupts_off();
    uint32_t status = SATELLITE_UART->STATUS;
    int inside = 0;
    if (sent_anything && !(status & USART_STATUS_TXC))
        inside = status & USART_STATUS_TXBL ? 1 : 2;
    int backlog = (int)(head - tail) + inside;
    interrupts_restore(masked);
    return backlog;
}

void uart_send_handler(void)
{
    while (head != tail && SATELLITE_UART->STATUS & USART_STATUS_TXBL)
        SATELLITE_UART->TXDATA = ring[tail++ % UART_SEND_BYTES];
    if (head == tail)
        SATELLITE_UART->IEN &= ~USART_IEN_TXBL;
}

void uart_receive_handler(void)
{
    while (SATELLITE_UART->STATUS & USART_STATUS_RXDATAV) {
        uint32_t received = SATELLITE_UART->RXDATAX;
        if (received & USART_RXDATAX_FERR)
            continue; /* no character */
        TIMER3->CNT = 0;
        TIMER3->CMD = TIMER_CMD_START;
        uart_received((uint8_t)received);
    }
    SATELLITE_UART->IFC = USART_IFC_FERR | USART_IFC_RXOF;
}

void TIMER3_handler(void)
{
    TIMER3->IFC = TIMER_IFC_OF;
    uart_silent();
}
