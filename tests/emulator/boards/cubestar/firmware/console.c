// Answers letters on the satellite's UART; each of them makes another way to the board work.
#include "board.h"

#define CLOCK_HZ 48000000u
#define CAMERA_ADDRESS 0x2Cu

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
    put("\n");
}

// By the first stimulus port of the trace unit, as printf over a debug probe does.
static void trace(const char *text) {
    *(volatile uint32_t *)0xE0000FB0 = 0xC5ACCE55;  // lock access
    *(volatile uint32_t *)0xE0000E80 |= 1;          // ITMENA
    *(volatile uint32_t *)0xE0000E00 |= 1;
    for (; *text; text++) {
        while (!(*(volatile uint32_t *)0xE0000000 & 1)) {}
        *(volatile uint8_t *)0xE0000000 = (uint8_t)*text;
    }
}

static int sent(void) {
    while (!(CAMERA_I2C->IF & (I2C_IF_ACK | I2C_IF_NACK))) {}
    const int acknowledged = (CAMERA_I2C->IF & I2C_IF_ACK) != 0;
    CAMERA_I2C->IFC = I2C_IFC_ACK | I2C_IFC_NACK;
    return acknowledged;
}

static int send(uint32_t byte) {
    CAMERA_I2C->TXDATA = byte;
    return sent();
}

// Two bytes of the camera's registers; 0xFFFFFFFF when nobody answers.
static uint32_t read_camera(uint32_t address) {
    CAMERA_I2C->CLKDIV = CLOCK_HZ / 100000u / 8u - 1u;
    CAMERA_I2C->ROUTE =
        I2C_ROUTE_SDAPEN | I2C_ROUTE_SCLPEN | CAMERA_I2C_LOCATION << I2C_ROUTE_LOCATION_SHIFT;
    CAMERA_I2C->CTRL = I2C_CTRL_EN;
    CAMERA_I2C->CMD = I2C_CMD_ABORT;
    uint32_t value = 0xFFFFFFFFu;
    CAMERA_I2C->TXDATA = CAMERA_ADDRESS << 1;
    CAMERA_I2C->CMD = I2C_CMD_START;
    if (sent() && send(address >> 8) && send(address & 0xFF)) {
        CAMERA_I2C->CMD = I2C_CMD_START;  // repeated
        CAMERA_I2C->TXDATA = CAMERA_ADDRESS << 1 | 1;
        if (sent()) {
            while (!(CAMERA_I2C->STATUS & I2C_STATUS_RXDATAV)) {}
            value = CAMERA_I2C->RXDATA << 8;
            CAMERA_I2C->CMD = I2C_CMD_ACK;
            while (!(CAMERA_I2C->STATUS & I2C_STATUS_RXDATAV)) {}
            value |= CAMERA_I2C->RXDATA;
            CAMERA_I2C->CMD = I2C_CMD_NACK;
        }
    }
    CAMERA_I2C->CMD = I2C_CMD_STOP;
    while (!(CAMERA_I2C->IF & I2C_IF_MSTOP)) {}
    CAMERA_I2C->IFC = I2C_IFC_MSTOP;
    return value;
}

// The comparator at the imager's current monitor, against 19/63 of 3.3 V: 199 mA.
static void await_overcurrent(void) {
    ACMP1->INPUTSEL = 0u << ACMP_INPUTSEL_POSSEL_SHIFT | 10u << ACMP_INPUTSEL_NEGSEL_SHIFT |
                      19u << ACMP_INPUTSEL_VDDLEVEL_SHIFT;
    ACMP1->CTRL = ACMP_CTRL_EN | 7u << ACMP_CTRL_BIASPROG_SHIFT | ACMP_CTRL_IRISE;
    while (!(ACMP1->STATUS & ACMP_STATUS_ACMPACT)) {}
    ACMP1->IFC = ACMP_IFC_EDGE;
    put("armed\n");
    while (!(ACMP1->IF & ACMP_IF_EDGE)) {}
    set(IMAGER_SWITCH, 0);
    put("cut\n");
}

// Milliamperes of the imager, by the ADC: 12 bits of 3.3 V, 5 V a milliampere less three noughts.
static uint32_t imager_ma(void) {
    ADC0->CTRL = 47u << ADC_CTRL_TIMEBASE_SHIFT | 5u << ADC_CTRL_PRESC_SHIFT;
    ADC0->SINGLECTRL = 5u << ADC_SINGLECTRL_INPUTSEL_SHIFT | 2u << ADC_SINGLECTRL_REF_SHIFT |
                       3u << ADC_SINGLECTRL_AT_SHIFT;
    ADC0->CMD = ADC_CMD_SINGLESTART;
    while (!(ADC0->STATUS & ADC_STATUS_SINGLEDV)) {}
    return (ADC0->SINGLEDATA * 3300u / 4096u + 2u) / 5u;
}

static void start_watchdog_and_stop(void) {
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_LE;
    WDOG->CTRL = WDOG_CTRL_EN | 5u << WDOG_CTRL_PERSEL_SHIFT;  // 257 cycles of 1 kHz
    put("stopped\n");
    __asm volatile("cpsid i");
    for (;;) {}
}

int main(void) {
    start_board();
    CMU->HFPERCLKEN0 |= CMU_HFPERCLKEN0_I2C1 | CMU_HFPERCLKEN0_ACMP1 | CMU_HFPERCLKEN0_ADC0 |
                        SATELLITE_UART_CLOCK;
    make(SATELLITE_UART_TX_PIN, 4);
    make(SATELLITE_UART_RX_PIN, 1);
    make(CAMERA_I2C_SDA_PIN, 10);
    make(CAMERA_I2C_SCL_PIN, 10);
    set(IMAGER_SWITCH, 1);
    make(IMAGER_SWITCH, 4);
    SATELLITE_UART->CLKDIV = (CLOCK_HZ * 16u / SATELLITE_BAUD - 256u) & USART_CLKDIV_DIV;
    SATELLITE_UART->ROUTE = USART_ROUTE_TXPEN | USART_ROUTE_RXPEN |
                            SATELLITE_UART_LOCATION << USART_ROUTE_LOCATION_SHIFT;
    SATELLITE_UART->CMD = USART_CMD_TXEN | USART_CMD_RXEN;
    put("boot ");
    put_number(RMU->RSTCAUSE);
    RMU->CMD = RMU_CMD_RCCLR;
    for (;;) {
        if (!(SATELLITE_UART->STATUS & USART_STATUS_RXDATAV))
            continue;
        switch (SATELLITE_UART->RXDATA) {
        case 'h': put("hello\n"), trace("traced\n"); break;
        case 'r': put_number(read_camera(0x851C)); break;
        case 'm': put_number(imager_ma()); break;
        case 'o': await_overcurrent(); break;
        case 'e':
            while (!(SATELLITE_UART->STATUS & USART_STATUS_TXC)) {}
            SATELLITE_UART->FRAME = 1u << 12 | 2u << 8 | 5u;  // 8 bits, even, one stop bit
            put("even\n");
            break;
        case 's': {
            register uint32_t call __asm("r0") = 4;  // SYS_WRITE0
            register const char *text __asm("r1") = "by the debugger\n";
            __asm volatile("bkpt 0xAB" : "+r"(call) : "r"(text) : "memory");
            put("said\n");
            break;
        }
        case 'w': start_watchdog_and_stop(); break;
        case 'f': *(volatile uint32_t *)0x60000000 = 1; break;
        default: put("?\n");
        }
    }
}
