// Captures an image through the FPGA whenever 'p' arrives on the satellite's UART, and answers with
// the sum of its pixels and the position of the brightest one. Complete from reset on;
// docs/how-to/own-firmware.md explains it.
#include "processor.h"  // from `cubestack export cubestar --format processor-c`

#define COLUMNS 1024u
#define ROWS 512u
#define CLOCK_HZ 48000000u
#define CAMERA_ADDRESS 0x2Cu

int main(void);
void reset_handler(void);
void fault_handler(void);
void systick_handler(void);
void uart_handler(void);

extern uint32_t stack_top, data_load, data_start, data_end, bss_start, bss_end;

// Start

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[16 + 39] = {
    (uintptr_t)&stack_top,
    (uintptr_t)reset_handler,
    (uintptr_t)fault_handler,
    (uintptr_t)fault_handler,
    [15] = (uintptr_t)systick_handler,
    [16 + SATELLITE_UART_RX_IRQ] = (uintptr_t)uart_handler,
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
    for (;;)
        __asm volatile("bkpt 0");
}

// Clock and pins

static volatile uint32_t milliseconds;

void systick_handler(void) { milliseconds++; }

static void sleep(void) { __asm volatile("wfi"); }

static void wait_ms(uint32_t count) {
    for (const uint32_t start = milliseconds; milliseconds - start < count;)
        sleep();
}

static void start_clock(void) {
    MSC->READCTRL = (MSC->READCTRL & ~MSC_READCTRL_MODE) | 4u << MSC_READCTRL_MODE_SHIFT;  // WS2
    CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_HFXORDY)) {}
    CMU->CMD = 2u << CMU_CMD_HFCLKSEL_SHIFT;  // HFXO
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_GPIO | CMU_HFPERCLKEN0_I2C1 | SATELLITE_UART_CLOCK;
    volatile uint32_t *const systick = (volatile uint32_t *)0xE000E010;
    systick[1] = CLOCK_HZ / 1000 - 1;
    systick[2] = 0;
    systick[0] = 7;
}

enum mode { INPUT = 1, PUSH_PULL = 4, OPEN_DRAIN_PULL_UP = 10 };

// Each port has these registers, in this order: CTRL, MODEL, MODEH, DOUT, DOUTSET, DOUTCLR, ...
static volatile uint32_t *port_of(unsigned pin) { return &GPIO->PA_CTRL + pin / 16 * 9; }

static void set(unsigned pin, unsigned level) { port_of(pin)[level ? 4 : 5] = 1u << pin % 16; }

static unsigned get(unsigned pin) { return port_of(pin)[7] >> pin % 16 & 1; }

static void make(unsigned pin, enum mode mode, unsigned level) {
    set(pin, level);
    volatile uint32_t *const modes = &port_of(pin)[1 + pin % 16 / 8];
    const unsigned shift = pin % 8 * 4;
    *modes = (*modes & ~(15u << shift)) | (uint32_t)mode << shift;
}

// UART

static volatile int command;

void uart_handler(void) { command = (int)SATELLITE_UART->RXDATA; }

static void start_uart(void) {
    make(SATELLITE_UART_TX_PIN, PUSH_PULL, 1);
    make(SATELLITE_UART_RX_PIN, INPUT, 1);
    // Sixteen samples per bit; the divider counts in 256ths.
    SATELLITE_UART->CLKDIV = (CLOCK_HZ * 16u / SATELLITE_BAUD - 256u) & USART_CLKDIV_DIV;
    SATELLITE_UART->ROUTE = USART_ROUTE_TXPEN | USART_ROUTE_RXPEN |
                            SATELLITE_UART_LOCATION << USART_ROUTE_LOCATION_SHIFT;
    SATELLITE_UART->CMD = USART_CMD_TXEN | USART_CMD_RXEN;
    SATELLITE_UART->IEN = USART_IEN_RXDATAV;
    volatile uint32_t *const enable = (volatile uint32_t *)0xE000E100;
    enable[SATELLITE_UART_RX_IRQ / 32] = 1u << SATELLITE_UART_RX_IRQ % 32;
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

// Camera

static void start_camera_bus(void) {
    make(CAMERA_I2C_SDA_PIN, OPEN_DRAIN_PULL_UP, 1);
    make(CAMERA_I2C_SCL_PIN, OPEN_DRAIN_PULL_UP, 1);
    CAMERA_I2C->CLKDIV = CLOCK_HZ / 100000u / 8u - 1u;
    CAMERA_I2C->ROUTE =
        I2C_ROUTE_SDAPEN | I2C_ROUTE_SCLPEN | CAMERA_I2C_LOCATION << I2C_ROUTE_LOCATION_SHIFT;
    CAMERA_I2C->CTRL = I2C_CTRL_EN;
    CAMERA_I2C->CMD = I2C_CMD_ABORT;
}

static int sent(void) {
    while (!(CAMERA_I2C->IF & (I2C_IF_ACK | I2C_IF_NACK))) {}
    const int acknowledged = (CAMERA_I2C->IF & I2C_IF_ACK) != 0;
    CAMERA_I2C->IFC = I2C_IFC_ACK | I2C_IFC_NACK;
    return acknowledged;
}

// Writes a register of `count` bytes, most significant byte first; returns 0 without an acknowledge.
static int write_camera(uint16_t address, uint32_t value, int count) {
    CAMERA_I2C->TXDATA = CAMERA_ADDRESS << 1;
    CAMERA_I2C->CMD = I2C_CMD_START;
    int acknowledged = sent();
    for (int i = 1 + count; acknowledged && i >= 0; i--) {
        const uint32_t byte = i < count ? value >> 8 * i : (uint32_t)address >> 8 * (i - count);
        CAMERA_I2C->TXDATA = byte & 0xFF;
        acknowledged = sent();
    }
    CAMERA_I2C->CMD = I2C_CMD_STOP;
    while (!(CAMERA_I2C->IF & I2C_IF_MSTOP)) {}
    CAMERA_I2C->IFC = I2C_IFC_MSTOP;
    return acknowledged;
}

// CubeStar thesis, appendix D: 8 bits, 2.59 frames per second (value 7), the longest exposure.
static int start_camera(void) {
    return write_camera(0x8100, 0x20, 1) && write_camera(0x851C, 7, 2) &&
           write_camera(0x8444, 0x0002, 2) && write_camera(0x8500, 0x03, 1);
}

// Image

static void start_fpga(void) {
    make(FPGA_ENABLE, PUSH_PULL, 0);
    make(FPGA_RNW, PUSH_PULL, 0);
    make(FPGA_BANK, PUSH_PULL, 0);
    make(FPGA_DCLK, PUSH_PULL, 0);
    make(FPGA_ACK, INPUT, 0);
    for (unsigned bit = 0; bit < 8; bit++)
        make(FPGA_DATA + bit, INPUT, 0);
}

static int take_picture(void) {
    if (!write_camera(0x8100, 0x21, 1))
        return 0;
    wait_ms(70);  // the first frame has no defined exposure
    set(FPGA_ENABLE, 1);
    const uint32_t start = milliseconds;
    while (!get(FPGA_ACK) && milliseconds - start < 2000) {}
    const int stored = (int)get(FPGA_ACK);
    set(FPGA_ENABLE, 0);
    return write_camera(0x8100, 0x20, 1) && stored;
}

static void read_picture(void) {
    volatile uint32_t *const clock = port_of(FPGA_DCLK), *const data = port_of(FPGA_DATA);
    const uint32_t edge = 1u << FPGA_DCLK % 16;
    uint32_t sum = 0, brightest = 0, place = 0;
    set(FPGA_RNW, 1);
    set(FPGA_ENABLE, 1);
    for (uint32_t i = 0; i < ROWS * COLUMNS; i++) {
        clock[4] = edge;
        const uint32_t pixel = data[7] >> FPGA_DATA % 16 & 0xFF;
        clock[5] = edge;
        sum += pixel;
        if (pixel > brightest) {
            brightest = pixel;
            place = i;
        }
    }
    set(FPGA_ENABLE, 0);
    set(FPGA_RNW, 0);
    put("sum ");
    put_number(sum);
    put(" brightest ");
    put_number(brightest);
    put(" at ");
    put_number(place % COLUMNS);
    put(",");
    put_number(place / COLUMNS);
    put("\n");
}

int main(void) {
    start_clock();
    start_uart();
    start_camera_bus();
    start_fpga();
    wait_ms(2);
    put(start_camera() ? "ready\n" : "no camera\n");
    for (;;) {
        while (!command)
            sleep();
        if (command != 'p')
            put("?\n");
        else if (take_picture())
            read_picture();
        else
            put("no picture\n");
        command = 0;
    }
}
