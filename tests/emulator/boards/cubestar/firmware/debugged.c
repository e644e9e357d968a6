// Sleeps between ticks and bytes; sends each byte back, and fails when it is a zero.
#include "board.h"

volatile uint32_t ticks, received, last;

void systick_handler(void) { ticks++; }

__attribute__((noinline)) static void fail(void) {
    *(volatile uint32_t *)0x70000000 = last;
    last = 1;
}

void uart_handler(void) {
    last = SATELLITE_UART->RXDATA;
    if (!last)
        fail();
    received++;
    SATELLITE_UART->TXDATA = last;
}

__attribute__((noinline)) static void sleep(void) {
    __asm volatile("wfi");
    __asm volatile("nop");
}

int main(void) {
    start_board();
    CMU->HFPERCLKEN0 |= SATELLITE_UART_CLOCK;
    make(SATELLITE_UART_TX_PIN, 4);
    make(SATELLITE_UART_RX_PIN, 1);
    SATELLITE_UART->CLKDIV = (48000000u * 16u / SATELLITE_BAUD - 256u) & USART_CLKDIV_DIV;
    SATELLITE_UART->ROUTE = USART_ROUTE_TXPEN | USART_ROUTE_RXPEN |
                            SATELLITE_UART_LOCATION << USART_ROUTE_LOCATION_SHIFT;
    SATELLITE_UART->CMD = USART_CMD_TXEN | USART_CMD_RXEN;
    SATELLITE_UART->IEN = USART_IEN_RXDATAV;
    ((volatile uint32_t *)0xE000E100)[SATELLITE_UART_RX_IRQ / 32] = 1u << SATELLITE_UART_RX_IRQ % 32;
    *(volatile uint32_t *)0xE000E014 = 47999;
    *(volatile uint32_t *)0xE000E018 = 0;
    *(volatile uint32_t *)0xE000E010 = 7;
    for (;;)
        sleep();
}
