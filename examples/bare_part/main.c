// For the starter kit: button 0 (PB9, low when pressed) switches LED 0 (PE2), and UART0 reports it, and
// whenever it receives a question mark.
#include "debounce.h"
#include "processor.h" // from `cubestack export efm32gg --format processor-c`

#define CLOCK_HZ 14000000u // the RC oscillator after a reset
#define BAUD 115200u
#define BUTTON 9
#define LED 2
#define UART_LOCATION 1u // TX is PE0, RX is PE1

static volatile uint32_t ticks;

void systick_handler(void) { ticks++; }

static void put(const char *text) {
    for (; *text; text++) {
        while (!(UART0->STATUS & USART_STATUS_TXBL)) {}
        UART0->TXDATA = (uint8_t)*text;
    }
}

int main(void) {
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_GPIO | CMU_HFPERCLKEN0_UART0;
    GPIO->PB_DOUT = 1u << BUTTON;                     // pulled up, not down
    GPIO->PB_MODEH = 2u << 4 * (BUTTON - 8);          // input with a pull
    GPIO->PE_DOUT = 1u;                               // TX is high when idle
    GPIO->PE_MODEL = 4u << 4 * LED | 4u | 1u << 4;    // LED and TX push-pull, RX input
    UART0->CLKDIV = (256u * (CLOCK_HZ / 16u) / BAUD - 256u) & ~0x3Fu;
    UART0->ROUTE = USART_ROUTE_TXPEN | USART_ROUTE_RXPEN | UART_LOCATION << USART_ROUTE_LOCATION_SHIFT;
    UART0->CMD = USART_CMD_TXEN | USART_CMD_RXEN;
    *(volatile uint32_t *)0xE000E014 = CLOCK_HZ / 1000u - 1u; // SysTick: every millisecond
    *(volatile uint32_t *)0xE000E010 = 7u;

    put("ready\n");
    struct button button = {0};
    for (;;) {
        const uint32_t now = ticks;
        while (now == ticks)
            __asm volatile("wfi");
        const bool pressed = debounce(&button, !(GPIO->PB_DIN >> BUTTON & 1u));
        if (pressed)
            GPIO->PE_DOUTTGL = 1u << LED;
        const bool asked = UART0->STATUS & USART_STATUS_RXDATAV && UART0->RXDATA == '?';
        if (pressed || asked)
            put(GPIO->PE_DOUT >> LED & 1u ? "on\n" : "off\n");
    }
}
