// Stores settings on command: "s NUMBER VALUE" answers "ok" or "failed", "g" lists the values.
#include "processor.h" // from `cubestack export cubestar --format processor-c`
#include "settings.h"

#define CLOCK_HZ 14000000u // RC oscillator, from reset on

int main(void);
void reset_handler(void);
void fault_handler(void);

extern uint32_t stack_top, data_load, data_start, data_end, bss_start, bss_end;

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16 + 39] = {
    (uintptr_t)&stack_top,
    (uintptr_t)reset_handler,
    (uintptr_t)fault_handler,
    (uintptr_t)fault_handler,
};

void reset_handler(void) {
    const uint32_t *from = &data_load;
    for (uint32_t *to = &data_start; to < &data_end;)
        *to++ = *from++;
    for (uint32_t *to = &bss_start; to < &bss_end;)
        *to++ = 0;
    main();
    fault_handler();
}

void fault_handler(void) {
    for (;;) {}
}

// Pins and UART

enum mode { INPUT = 1, PUSH_PULL = 4 };

// Each port has these registers, in this order: CTRL, MODEL, MODEH, DOUT, DOUTSET, ...
static void make(unsigned pin, enum mode mode) {
    volatile uint32_t *const port = &GPIO->PA_CTRL + pin / 16 * 9;
    volatile uint32_t *const modes = &port[1 + pin % 16 / 8];
    port[4] = 1u << pin % 16;
    *modes |= (uint32_t)mode << pin % 8 * 4;
}

#define NVIC_ENABLE ((volatile uint32_t *)0xE000E100)
#define NVIC_CLEAR ((volatile uint32_t *)0xE000E280)

static void start_uart(void) {
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_GPIO | SATELLITE_UART_CLOCK;
    make(SATELLITE_UART_TX_PIN, PUSH_PULL);
    make(SATELLITE_UART_RX_PIN, INPUT);
    // The divider counts in 256ths, in steps of 64 of them.
    SATELLITE_UART->CLKDIV = (CLOCK_HZ * 16u / SATELLITE_BAUD - 256u + 32u) & USART_CLKDIV_DIV;
    SATELLITE_UART->ROUTE = USART_ROUTE_TXPEN | USART_ROUTE_RXPEN |
                            SATELLITE_UART_LOCATION << USART_ROUTE_LOCATION_SHIFT;
    SATELLITE_UART->CMD = USART_CMD_TXEN | USART_CMD_RXEN;
    SATELLITE_UART->IEN = USART_IEN_RXDATAV; // only wakes: interrupts stay masked
    __asm volatile("cpsid i");
    NVIC_ENABLE[SATELLITE_UART_RX_IRQ / 32] = 1u << SATELLITE_UART_RX_IRQ % 32;
}

static char get(void) {
    while (!(SATELLITE_UART->STATUS & USART_STATUS_RXDATAV))
        __asm volatile("wfi");
    const char character = (char)SATELLITE_UART->RXDATA;
    NVIC_CLEAR[SATELLITE_UART_RX_IRQ / 32] = 1u << SATELLITE_UART_RX_IRQ % 32;
    return character;
}

static void put(const char *text) {
    for (; *text; text++) {
        while (!(SATELLITE_UART->STATUS & USART_STATUS_TXBL)) {}
        SATELLITE_UART->TXDATA = (uint8_t)*text;
    }
}

static void put_number(uint32_t number) {
    char digits[11], *digit = digits + 10;
    *digit = 0;
    do
        *--digit = (char)('0' + number % 10);
    while (number /= 10);
    put(digit);
}

// Commands

static char line[32];

static void get_line(void) {
    unsigned length = 0;
    for (char one; (one = get()) != '\n';)
        if (length < sizeof line - 1)
            line[length++] = one;
    line[length] = 0;
}

static uint32_t number_at(const char **text) {
    uint32_t number = 0;
    while (**text == ' ')
        ++*text;
    for (; **text >= '0' && **text <= '9'; ++*text)
        number = 10 * number + (uint32_t)(**text - '0');
    return number;
}

static void list(void) {
    for (unsigned number = 0; number < SETTINGS; number++) {
        put_number(settings_get(number));
        put(number + 1 < SETTINGS ? " " : "\n");
    }
}

int main(void) {
    settings_load();
    start_uart();
    put("ready\n");
    for (;;) {
        get_line();
        const char *rest = line + 1;
        const uint32_t number = number_at(&rest), value = number_at(&rest);
        if (line[0] == 'g')
            list();
        else if (line[0] == 's' && number < SETTINGS)
            put(settings_set(number, value) ? "ok\n" : "failed\n");
        else
            put("?\n");
    }
}
